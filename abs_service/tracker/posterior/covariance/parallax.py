"""Parallax of the appearance: an error along the surface that lasts, of a mesh that lies where its model was fitted.

A model that is fitted to the first image, as that of a strip, is off by e along the normal of each vertex: smoothly, as
its parameters allow, and much more than averages of later frames. Later distances move it back. But its colours were
taken where their lines of sight met it, and they hold every vertex on its line of sight d: on a surface with the normal
n, it then is e (d / (n · d) − n) beside the material point.

With the derivatives D of the vertices with respect to Θ, and deviations σ of the distances measured at them, the
variance of e is that of a fit of Θ to the distances of one image, nᵀD (Σ Dᵀn nᵀD / σ²)⁻¹ Dᵀn.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.covariance.tangents import Tangents, along_tangents
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.terms.gradients import MIN_COSINE


class Parallax(Protocol):
    """Covariance of the vertices by the parallax of their appearance."""

    def covariance(self, optimum: Optimum, frame: FramePosterior) -> NDArray[np.float64]:
        """Covariance (n, 3, 3) [m²] of the vertices of an estimate; its size is computed with the first one."""
        ...


class NoParallax:
    """No parallax: the vertices were measured one by one, so that their errors average out, or the shape is known."""

    def covariance(self, optimum: Optimum, frame: FramePosterior) -> NDArray[np.float64]:
        """Zeros (n, 3, 3)."""
        return np.zeros((optimum.surface.vertices.shape[2], 3, 3))


class FittedParallax:
    """Parallax of a mesh that lies where the model was fitted to the first image.

    Args:
        model: the deformation model.
        centers: of the cameras that the appearance was taken with, each (3,) [m], at least one.
    """

    def __init__(self, model: DeformationModel, centers: Sequence[NDArray[np.float64]]):
        self._model = model
        self._centers = centers
        self._tangents = Tangents(model.mesh)
        self._error = np.zeros((0, 2))

    def covariance(self, optimum: Optimum, frame: FramePosterior) -> NDArray[np.float64]:
        """Covariance of one error in all frames, which turns with the surface."""
        tangents = self._tangents.along(optimum.surface)
        if not len(self._error):
            self._error = np.vecdot(tangents, self._first(optimum, frame)[:, None])
        return along_tangents(tangents, self._error)

    def _first(self, optimum: Optimum, frame: FramePosterior) -> NDArray[np.float64]:
        """One deviation of the error (n, 3) [m]; none without distances at the vertices."""
        normals = optimum.surface.normals[0].T.astype(np.float64)
        deviation = np.broadcast_to(frame.misfit(optimum.surface)[1], len(normals))
        across = np.einsum("ni,nid->nd", normals, self._model.sparse_jacobian(optimum.theta).dense)
        measured = deviation > 0
        rows = across[measured] / deviation[measured, None]
        fitted = np.linalg.inv(rows.T @ rows + np.diag(1.0 / self._model.scales**2))  # nothing moves by more than 1 m
        size = np.sqrt(np.einsum("nd,de,ne->n", across, fitted, across)) * measured
        return size[:, None] * np.mean([self._beside(optimum, normals, center) for center in self._centers], axis=0)

    @staticmethod
    def _beside(optimum: Optimum, normals: NDArray[np.float64], center: NDArray[np.float64]) -> NDArray[np.float64]:
        """The vectors d / (n · d) − n (n, 3) of the lines of sight from a camera's centre."""
        sight = optimum.surface.vertices[0].T - center
        sight = sight / np.linalg.norm(sight, axis=1, keepdims=True)
        cosine = np.minimum(np.vecdot(sight, normals), -MIN_COSINE)
        return sight / cosine[:, None] - normals
