"""Plausibility of a deformed mesh by itself: stretch, folds, and how well its vertices are known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, area_vectors, edge_lengths

#: Neighbouring faces are folded if their normals differ by more than 120°, and by less than 60° at rest.
FOLDED_COSINE, UNFOLDED_COSINE = -0.5, 0.5


@dataclass(frozen=True, slots=True)
class ShapeQuality:
    """Plausibility of one deformed mesh by itself.

    Attributes:
        stretch: relative change of the length of an edge, 95th percentile.
        folded_share: share of the pairs of neighbouring faces that are folded onto each other, 0…1.
        deviation_m: standard deviation of the position of a vertex, median [m].
        single_frame_deviation_m: the same by the measurements of this frame alone, without the past [m].
    """

    stretch: float = 0.0
    folded_share: float = 0.0
    deviation_m: float = float("nan")
    single_frame_deviation_m: float = float("nan")


class ShapeComparison:
    """Compares deformed meshes with the undeformed one.

    Args:
        mesh: the undeformed mesh.
    """

    def __init__(self, mesh: Mesh):
        self._faces, self._edges = mesh.faces, mesh.edges
        self._lengths = edge_lengths(mesh.vertices, self._edges)
        pairs = _neighbors(mesh.faces)
        normals = _normals(mesh.vertices, mesh.faces)
        even = np.einsum("pi,pi->p", normals[pairs[:, 0]], normals[pairs[:, 1]]) > UNFOLDED_COSINE
        self._pairs = pairs[even]

    def compare(
        self, vertices: NDArray[np.floating], vertex_covariance: NDArray[np.float64], single_frame_deviation_m: float
    ) -> ShapeQuality:
        """Quality of deformed vertices (n, 3) [m] with covariances (n, 3, 3) [m²].

        Args:
            vertices: deformed vertices.
            vertex_covariance: of every vertex.
            single_frame_deviation_m: see `ShapeQuality`.
        """
        stretch = np.abs(edge_lengths(vertices, self._edges) / self._lengths - 1)
        normals = _normals(vertices, self._faces)
        cosine = np.einsum("pi,pi->p", normals[self._pairs[:, 0]], normals[self._pairs[:, 1]])
        variance = np.einsum("nii->n", vertex_covariance)
        return ShapeQuality(
            stretch=float(np.percentile(stretch, 95)),
            folded_share=float(np.mean(cosine < FOLDED_COSINE)) if len(cosine) else 0.0,
            deviation_m=float(np.sqrt(np.median(variance))),
            single_frame_deviation_m=single_frame_deviation_m,
        )


def _normals(vertices: NDArray[np.floating], faces: NDArray[np.int32]) -> NDArray[np.floating]:
    """Unit normals (m, 3) of the faces."""
    normals = area_vectors(vertices, faces)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _neighbors(faces: NDArray[np.int32]) -> NDArray[np.intp]:
    """Pairs of faces (p, 2) that share an edge."""
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    order = np.lexsort(sides.T)
    same = np.flatnonzero(np.all(sides[order[1:]] == sides[order[:-1]], axis=1))
    return np.stack([order[same], order[same + 1]], axis=1) % len(faces)
