"""Covariance of every vertex: from the errors of Θ, those of the initial mesh, and misfit that neither explains."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.covariance.appearance_misfit import (
    AppearanceMisfit,
    NoDisplacement,
    SurfaceDisplacement,
)
from abs_service.tracker.posterior.covariance.first_frame_slide import FirstFrameSlide, NoSlide, Slide
from abs_service.tracker.posterior.covariance.mesh_noise import MeshNoise
from abs_service.tracker.posterior.covariance.misfit import Misfit
from abs_service.tracker.posterior.covariance.parallax import FittedParallax, NoParallax, Parallax
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.terms.linearization import propagated
from calib.jit import kernel


class VertexCovariance:
    """Covariance of the vertices of one mesh around their material points, over time.

    Args:
        model: the deformation model.
        registration_m: standard deviation of the pose of a template's mesh; 0 if the first frame defines it [m].
        centers: of the cameras that the appearance is taken with, each (3,) [m].
    """

    def __init__(self, model: DeformationModel, registration_m: float, centers: Sequence[NDArray[np.float64]]):
        is_new = registration_m == 0  # made from the first frame
        is_fitted = is_new and len(centers) > 0 and not np.any(model.mesh.deviation)
        self._parallax: Parallax = FittedParallax(model, centers) if is_fitted else NoParallax()
        self._slide: Slide = FirstFrameSlide(model.mesh) if is_new else NoSlide()
        self._mesh_noise = MeshNoise(model)
        self._misfit = Misfit(model.mesh)
        self._displacement: SurfaceDisplacement = AppearanceMisfit(model.mesh) if len(centers) else NoDisplacement()
        self._began = False

    def restart(self) -> None:
        """Restarts, after a relocation, with a frame in which nothing may have moved yet."""
        self._began = False

    def update(
        self, optimum: Optimum, frame: FramePosterior, theta_covariance: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Covariance (n, 3, 3) [m²] of the vertices of a frame's estimate.

        Args:
            optimum: the estimate, and the cost around it.
            frame: the frame's posterior.
            theta_covariance: covariance (dim, dim) of the estimate.
        """
        near = optimum.linearized
        if self._began and near.sensed:  # nothing has moved in the first frame, nothing is known in one without images
            self._mesh_noise.update(frame, optimum.theta)
        self._began = True
        along_surface = propagated(near.sparse_jacobian, theta_covariance) + self._parallax.covariance(optimum, frame)
        covariance = along_surface + self._slide.beyond(optimum.surface, along_surface)
        distance, deviation = frame.misfit(optimum.surface)
        across, along = self._misfit.update(distance, deviation, self._mesh_noise.variance)
        along = self._displacement.variance(optimum, along)
        add_errors(optimum.surface.normals[0], across + self._mesh_noise.variance, along, covariance)
        return covariance


@kernel
def add_errors(
    normals: NDArray[np.float32],
    across: NDArray[np.float64],
    along: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> None:
    """Adds those of errors with variances along the normals (3, n), and in all directions along the surface.

    Args:
        normals: of the vertices.
        across, along: variances (n,) [m²].
        covariance: of the vertices (n, 3, 3) [m²].
    """
    for v in range(across.size):
        for i in range(3):
            share = (across[v] - along[v]) * normals[i, v]
            covariance[v, i, i] += along[v]
            for j in range(3):
                covariance[v, i, j] += share * normals[j, v]
