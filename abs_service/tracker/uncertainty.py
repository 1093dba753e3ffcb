"""How well every vertex is known, given how well Θ is."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.curvature import vertex_jacobian
from abs_service.tracker.models.base import DeformationModel, Surface


def of_vertices(
    model: DeformationModel, theta: NDArray[np.float64], surface: Surface, covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance (n, 3, 3) [m²] of the vertices around their material points.

    Args:
        model: the deformation model.
        theta: parameters (dim,).
        surface: the mesh at theta, a population of one.
        covariance: of theta (dim, dim).
    """
    moved = propagated(vertex_jacobian(model, theta), covariance)
    return moved + along(surface.normals[0].T.astype(np.float64), model.mesh.deviation)


def propagated(jacobian: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """J Σ Jᵀ (n, 3, 3) of every vertex, for derivatives (n, 3, dim) and the covariance Σ (dim, dim) of Θ."""
    n, axes, dimension = jacobian.shape
    # One product of matrices for all vertices: n small ones take several times as long.
    weighted = (jacobian.reshape(-1, dimension) @ covariance).reshape(n, axes, dimension)
    return weighted @ jacobian.transpose(0, 2, 1)


def along(normals: NDArray[np.float64], deviation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (n, 3, 3) of what was wrong with the mesh before it was deformed: σ² n nᵀ.

    Every vertex is bound to the surface where the first frame's noise put it, and keeps that offset along the normal in
    all frames. No parameter moves a vertex alone, so no later measurement tells Θ about it.

    Args:
        normals: unit normals (n, 3) of the deformed mesh.
        deviation: σ of the vertices (n,) or of all alike () [m].
    """
    offset = normals * np.reshape(deviation, (-1, 1))
    return offset[:, :, None] * offset[:, None, :]
