"""Covariance of every frame's estimate: of Θ and of the vertices, with all that is known of their errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel, Surface
from abs_service.tracker.posterior.correlation import DesignEffects
from abs_service.tracker.posterior.covariance import (
    along_normals,
    isotropic,
    leverages,
    propagated,
    score_covariance,
    shared_covariance,
    unheld_deviation,
    unseen_motion,
)
from abs_service.tracker.posterior.mesh_noise import MeshNoise
from abs_service.tracker.posterior.misfit import Misfit
from abs_service.tracker.posterior.placement import placement_covariance
from abs_service.tracker.posterior.posterior import FramePosterior
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.propagation import ErrorPropagation


@dataclass(frozen=True, slots=True, eq=False)
class Covariances:
    """Covariances of one estimate.

    Attributes:
        theta: of Θ (dim, dim).
        vertices: of every vertex around its material point (n, 3, 3) [m²].
        unheld_m: standard deviation of a vertex by the measurements of this frame alone, median [m].
    """

    theta: NDArray[np.float64]
    vertices: NDArray[np.float64]
    unheld_m: float


class Uncertainty:
    """Covariances of the estimates of one mesh over time.

    Args:
        model: the deformation model.
        motion: the motion prior.
        placement_m: standard deviation of the place of the mesh at rest; 0 if the first frame defines it [m].
    """

    def __init__(self, model: DeformationModel, motion: MotionPrior, placement_m: float):
        self._motion = motion
        self._mesh_noise = MeshNoise(model)
        self._effects = DesignEffects(model.mesh)
        self._errors = ErrorPropagation(placement_covariance(model, placement_m))
        self._misfit = Misfit(model.mesh)
        self._begun = False

    def relocate(self) -> None:
        """Forgets the past, after the mesh was laid over a detected object."""
        self._errors.restart(self._motion.longest_covariance)
        self._begun = False

    def estimate(
        self, frame: FramePosterior, theta: NDArray[np.float64], surface: Surface, inverse: NDArray[np.float64]
    ) -> Covariances:
        """Covariances of the estimate of a frame.

        Args:
            frame: the frame's posterior.
            theta: the estimate (dim,).
            surface: its surface, a population of one.
            inverse: Σ (dim, dim), the inverse curvature of the cost.
        """
        near, precision = frame.linearized_near(theta), self._motion.precision
        if self._begun and near.sensed:  # nothing has moved in the first frame, nothing is known in one without images
            self._mesh_noise.update(frame, theta)
        self._begun = True
        curvature = near.quadratic.curvature
        leverage = leverages(inverse, near.sensed)
        effects = self._effects.update(inverse, near.sensed, leverage)
        scores = score_covariance(near.priors, near.sensed, leverage, effects)
        shared = shared_covariance(near.sensed, len(theta))
        without_motion, least_precision = curvature - precision, self._motion.least_precision
        moved = unseen_motion(self._motion.unseen, without_motion, least_precision)
        motion = self._motion.unpredicted, moved, self._motion.persistence
        covariance = self._errors.update(*motion, inverse, scores, shared, precision)
        vertices = (
            propagated(near.sparse_jacobian, covariance)
            + along_normals(surface, self._mesh_noise.variance)
            + isotropic(self._misfit.variance(*frame.misfit(surface)))
        )
        unheld_m = unheld_deviation(without_motion, least_precision, near.sparse_jacobian)
        return Covariances(covariance, vertices, unheld_m)
