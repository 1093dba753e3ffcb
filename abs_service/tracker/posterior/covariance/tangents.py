"""Tangents of a surface at the vertices of its mesh, which turn with it."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface


class Tangents:
    """Orthonormal tangents at the vertices of a mesh, of whatever it is deformed into."""

    def __init__(self, mesh: Mesh):
        self._beside = np.arange(len(mesh.vertices))
        for one, other in (mesh.edges.T, mesh.edges.T[::-1]):
            self._beside[one] = other  # always the same neighbour

    def along(self, surface: Surface) -> NDArray[np.float64]:
        """Tangents (n, 2, 3) of a population of one: towards a neighbour, and across that."""
        vertices, normals = (one[0].T.astype(np.float64) for one in (surface.vertices, surface.normals))
        edge = vertices[self._beside] - vertices
        first = edge - np.vecdot(edge, normals)[:, None] * normals
        first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.finfo(float).tiny)
        return np.stack([first, np.cross(normals, first)], axis=1)


def along_tangents(tangents: NDArray[np.float64], error: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (n, 3, 3) of an error with the components (n, 2) along tangents (n, 2, 3)."""
    vectors = np.einsum("nki,nk->ni", tangents, error)
    return vectors[:, :, None] * vectors[:, None, :]
