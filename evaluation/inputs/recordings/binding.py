"""Points that are fixed to the material of a mesh, and move with it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Binding:
    """Points bound to the faces of a mesh.

    Attributes:
        corners: vertex indices (k, 3) of each point's face.
        weights: barycentric coordinates (k, 3) in the plane of the face; negative for a point beside it.
        offset: height (k,) [m] above the face along its normal.
        bound: which of the given points (n,) are bound, k in all; the others are beyond the mesh.
    """

    corners: NDArray[np.integer]
    weights: Points
    offset: Points
    bound: NDArray[np.bool_]

    def points(self, vertices: NDArray[np.floating]) -> Points:
        """Positions (k, 3) [m] of the bound points on the mesh with these vertices (n, 3) [m]."""
        corners = np.asarray(vertices, np.float64)[self.corners]
        return _combined(self.weights, corners) + self.offset[:, None] * self.normals(vertices)

    def normals(self, vertices: NDArray[np.floating]) -> Points:
        """Unit normals (k, 3) of the faces that the points are bound to."""
        return normals(np.asarray(vertices, np.float64)[self.corners])

    def covariance(self, vertex_covariance: NDArray[np.floating]) -> Points:
        """Covariances (k, 3, 3) [m²] of the bound points: those of the vertices (n, 3, 3) [m²], interpolated.

        Points beside the mesh get the covariance of its rim.
        """
        weights = np.clip(self.weights, 0, None)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.einsum("kc,kcij->kij", weights, np.asarray(vertex_covariance, np.float64)[self.corners])


def bind(points: Points, vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Binding:
    """Binds points (n, 3) [m] to their nearest faces (m, 3) of a mesh with vertices (v, 3) [m].

    A point that is beside the mesh by more than a cell, the median edge length, is not bound.
    """
    corners = np.asarray(vertices, np.float64)[faces]
    feet = _feet(points, corners)
    away = np.linalg.norm(_combined(feet, corners) - points[:, None], axis=-1)
    face = np.argmin(away, axis=1)
    own, rows = corners[face], np.arange(len(points))
    weights = _plane_weights(points[:, None], own[:, None])[:, 0]
    in_plane = _combined(weights, own)
    beside = np.linalg.norm(in_plane - _combined(feet[rows, face], own), axis=1)
    bound = beside <= np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1))
    offset = np.einsum("ki,ki->k", points - in_plane, normals(own))
    return Binding(np.asarray(faces)[face][bound], weights[bound], offset[bound], bound)


def bind_rays(rays: Points, vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Binding:
    """Binds the nearest points where rays (n, 3) from the origin meet a mesh; rays that miss it are not bound."""
    corners = np.asarray(vertices, np.float64)[faces]
    # λ ray = Σ wᵢ vᵢ with Σ wᵢ = 1, so w is what solves V w = ray, divided by its sum, which is 1 / λ.
    solved = np.einsum("mij,nj->nmi", np.linalg.pinv(np.swapaxes(corners, 1, 2)), rays)
    inverse = solved.sum(axis=-1)
    hit = (solved >= 0).all(axis=-1) & (inverse > 0)
    face = np.argmax(np.where(hit, inverse, -np.inf), axis=1)
    bound = hit.any(axis=1)
    weights = solved[bound, face[bound]]
    weights /= weights.sum(axis=1, keepdims=True)
    return Binding(np.asarray(faces)[face][bound], weights, np.zeros(len(weights)), bound)


def normals(corners: Points) -> Points:
    """Unit normals (…, 3) of triangles (…, 3, 3)."""
    normal = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _combined(weights: Points, corners: Points) -> Points:
    """Σ weight · corner (…, 3)."""
    return np.einsum("...c,...ci->...i", weights, corners)


def _plane_weights(points: Points, corners: Points) -> Points:
    """Barycentric coordinates (…, 3) of the feet of points (…, 3) in the planes of triangles (…, 3, 3)."""
    origin = corners[..., 0, :]
    sides = np.swapaxes(corners[..., 1:, :] - origin[..., None, :], -1, -2)
    along = np.einsum("...ji,...i->...j", np.linalg.pinv(sides), points - origin)
    return np.concatenate([1 - along.sum(axis=-1, keepdims=True), along], axis=-1)


def _feet(points: Points, corners: Points) -> Points:
    """Barycentric coordinates (n, m, 3) of the nearest place of every triangle (m, 3, 3) to every point (n, 3)."""
    best = _plane_weights(points[:, None], corners[None])
    least = np.where((best >= 0).all(axis=-1), 0.0, np.inf)
    for side in range(3):
        start, end = corners[:, side], corners[:, (side + 1) % 3]
        along = np.einsum("nmi,mi->nm", points[:, None] - start, end - start)
        along = np.clip(along / np.sum((end - start) ** 2, axis=-1), 0, 1)
        weights = np.zeros_like(best)
        weights[..., side], weights[..., (side + 1) % 3] = 1 - along, along
        away = np.linalg.norm(_combined(weights, corners) - points[:, None], axis=-1)
        nearer = away < least
        best[nearer], least[nearer] = weights[nearer], away[nearer]
    return best
