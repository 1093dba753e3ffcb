"""Noise of the mesh itself: its vertices were placed by one noisy image, and perhaps by more since."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.covariance import uncorrected_variance
from abs_service.tracker.posterior.curvature import Quadratic, posterior_covariance


class Linearizable(Protocol):
    """The cost of a frame, as far as `MeshNoise` needs it; see `FramePosterior`."""

    def linearize(self, theta: NDArray[np.float64]) -> Quadratic:
        """Gauss–Newton approximation of the cost near theta (dim,)."""
        ...

    def cross_curvature(self, theta: NDArray[np.float64], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        """JᵀJE (dim, n)."""
        ...


class MeshNoise:
    """The part of the vertices' initial errors along their normals that theta does not correct.

    Computed once per mesh, because its share of the mesh's own variance hardly changes with the deformation; on the
    second frame, because in the first nothing may have moved and the priors keep theta from correcting anything.

    Args:
        model: the deformation model; its mesh has a deviation per vertex, which shrinks where offsets are learnt.
    """

    def __init__(self, model: DeformationModel):
        self._share = np.ones(len(model.mesh.vertices))
        self._model = model
        self._updated = not np.any(model.mesh.deviation)

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variance along the normals (n,) [m²]; before `update`, that of the mesh."""
        return self._share * self._model.mesh.deviation**2

    def update(self, frame: Linearizable, theta: NDArray[np.float64]) -> None:
        """Computes the share at theta (dim,) of the second frame; later calls change nothing."""
        if self._updated:
            return
        self._updated = True
        normals = self._model.deform(theta[None]).normals[0].T.astype(np.float64)
        deviation = np.broadcast_to(self._model.mesh.deviation, len(normals))
        inverse = posterior_covariance(frame.linearize(theta))
        response = -inverse @ frame.cross_curvature(theta, normals * deviation[:, None])
        left = uncorrected_variance(normals, deviation, self._model.jacobian(theta), response)
        self._share = left / np.maximum(deviation, np.finfo(float).eps) ** 2
