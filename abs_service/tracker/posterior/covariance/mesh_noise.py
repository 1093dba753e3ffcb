"""Noise of the mesh itself: its vertices were placed by one noisy image, and perhaps by more since.

The noise of the first frame displaces every vertex by σε along its normal n, with ε standard normal; the vertex keeps
what of this offset is not learnt over the frames (`tracking.offsets`). The sensors measure the surface, not the vertex.
The search therefore corrects the part of the offsets that Θ can represent, and only the rest remains. With the
derivatives D of the vertices, the offsets E = σn, and the derivatives JE of the residuals with respect to ε, the
response of Θ is −Σ JᵀJE ε, and the error of a vertex is (E − D Σ JᵀJE) ε besides D times the error of Θ. Where the
sensors outweigh the priors, D Σ JᵀJ is the projection Π onto the range of D, and σ²(I − Π) remains.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.curvature import posterior_covariance
from abs_service.tracker.posterior.frame_posterior import FramePosterior


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

    def update(self, frame: FramePosterior, theta: NDArray[np.float64]) -> None:
        """Computes the share at theta (dim,) of the second frame; later calls change nothing."""
        if self._updated:
            return
        self._updated = True
        normals = self._model.deform(theta[None]).normals[0].T.astype(np.float64)
        deviation = np.broadcast_to(self._model.mesh.deviation, len(normals))
        inverse = posterior_covariance(frame.linearize(theta).quadratic)
        response = -inverse @ frame.cross_curvature(theta, normals * deviation[:, None])
        left = uncorrected_variance(normals, deviation, self._model.sparse_jacobian(theta).dense, response)
        self._share = left / np.maximum(deviation, np.finfo(float).eps) ** 2


def uncorrected_variance(
    normals: NDArray[np.float64],
    deviation: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    response: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Variance (n,) [m²] along the normals of the part of the mesh's own errors that Θ does not correct.

    Args:
        normals: unit normals (n, 3).
        deviation: σ of the vertices along them (n,) [m].
        jacobian: D, derivatives (n, 3, dim) of the vertices.
        response: −Σ JᵀJE, the change (dim, n) of Θ that each vertex's error causes.
    """
    left = np.einsum("ni,nid->nd", normals, jacobian) @ response
    left.flat[:: len(left) + 1] += deviation
    return np.einsum("nk,nk->n", left, left)
