"""Covariances of the estimates of one object over time: of theta, of the vertices, and of motion that nothing shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.covariance.observability import single_frame_deviation
from abs_service.tracker.posterior.covariance.slides import SlideObservability
from abs_service.tracker.posterior.covariance.theta_covariance import ThetaCovariance
from abs_service.tracker.posterior.covariance.vertex_covariance import VertexCovariance
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.posterior.priors.motion_prior import RecentMotion
from abs_service.tracker.posterior.slide_drift import SlideDrift


@dataclass(frozen=True, slots=True, eq=False)
class EstimateCovariance:
    """Covariances of the estimate of one frame.

    Attributes:
        theta: of the parameters (dim, dim).
        vertices: of the vertices around their material points (n, 3, 3) [m²].
        without_drift: the same without drift along slides: bounds the error that measurements would show (n, 3, 3).
        single_frame_deviation_m, no_outline_deviation_m: see `ShapeQuality`.
    """

    theta: NDArray[np.float64]
    vertices: NDArray[np.float64]
    without_drift: NDArray[np.float64]
    single_frame_deviation_m: float
    no_outline_deviation_m: float


class Uncertainty:
    """Errors of the estimates of one object, carried from frame to frame.

    Args:
        model: the deformation model.
        registration_m: standard deviation of the pose of a template's mesh; 0 if the first frame defines it [m].
        centers: centres of the imaging sensors, each (3,) [m].
    """

    def __init__(self, model: DeformationModel, registration_m: float, centers: Sequence[NDArray[np.float64]]):
        self._theta = ThetaCovariance(model, registration_m)
        self._vertices = VertexCovariance(model, registration_m, centers)
        self._slides, self._drift = SlideObservability(model), SlideDrift()

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Restarts after a relocation, with the covariance (dim, dim) of theta there."""
        self._theta.restart(covariance)
        self._vertices.restart()
        self._drift.restart()

    def update(self, optimum: Optimum, frame: FramePosterior, recent: RecentMotion) -> EstimateCovariance:
        """The covariances of a frame's estimate, from its measurements and the estimates before.

        Args:
            optimum: the estimate, and the cost around it.
            frame: the frame's posterior.
            recent: motion of theta up to this frame.
        """
        theta = self._theta.update(optimum, frame, recent)
        vertices = self._vertices.update(optimum, frame, theta)
        drift = self._drift.update(self._slides.of(optimum), frame.motion)
        return EstimateCovariance(
            theta,
            vertices + drift.covariance,
            without_drift=vertices,
            single_frame_deviation_m=max(single_frame_deviation(optimum, frame.motion), drift.slides.deviation_m),
            no_outline_deviation_m=drift.slides.no_outline_deviation_m,
        )
