"""Plausibility of a deformed mesh by itself: stretch, folds, and how well its vertices are known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, area_vectors, edge_lengths, sides_of, unit
from calib.jit import kernel

#: Neighbouring faces are folded if their normals differ by more than 120°, and by less than 60° at rest.
FOLDED_COSINE, UNFOLDED_COSINE = -0.5, 0.5

#: Share of the edges that are stretched less than the stated stretch of a mesh.
STRETCHED = 0.95


@dataclass(frozen=True, slots=True)
class ShapeQuality:
    """Plausibility of one deformed mesh by itself.

    Attributes:
        stretch: relative change of the length of an edge, 95th percentile.
        folded_share: share of the pairs of neighbouring faces that are folded onto each other, 0…1.
        deviation_m: standard deviation of the position of a vertex, median [m].
        single_frame_deviation_m: the same by the measurements of this frame alone, without the past [m].
        no_outline_deviation_m: the same along the rigid motion that is held least, without the outline [m].
    """

    stretch: float = 0.0
    folded_share: float = 0.0
    deviation_m: float = float("nan")
    single_frame_deviation_m: float = float("nan")
    no_outline_deviation_m: float = float("nan")


class ShapeComparison:
    """Compares deformed meshes with the undeformed one."""

    def __init__(self, mesh: Mesh):
        self._edges = mesh.edges
        self._lengths = edge_lengths(mesh.vertices, self._edges)
        pairs = _neighbors(mesh.faces)
        normals = unit(area_vectors(mesh.vertices, mesh.faces))
        even = np.einsum("pi,pi->p", normals[pairs[:, 0]], normals[pairs[:, 1]]) > UNFOLDED_COSINE
        self._pairs = pairs[even]
        self._corners = mesh.faces[self._pairs].reshape(-1, 6)

    def compare(
        self,
        vertices: NDArray[np.floating],
        vertex_covariance: NDArray[np.float64],
        single_frame_deviation_m: float,
        no_outline_deviation_m: float,
    ) -> ShapeQuality:
        """Quality of deformed vertices (n, 3) [m] with covariances (n, 3, 3) [m²].

        Args:
            vertices: deformed vertices.
            vertex_covariance: of every vertex.
            single_frame_deviation_m, no_outline_deviation_m: see `ShapeQuality`.
        """
        stretch, variance = np.empty(len(self._edges)), np.einsum("nii->n", vertex_covariance)
        folded = compare_shapes(vertices, self._edges, self._lengths, self._corners, stretch)
        return ShapeQuality(
            stretch=percentile(stretch, STRETCHED),
            folded_share=folded / len(self._pairs) if len(self._pairs) else 0.0,
            deviation_m=float(np.sqrt(percentile(variance, 0.5))),
            single_frame_deviation_m=single_frame_deviation_m,
            no_outline_deviation_m=no_outline_deviation_m,
        )


def percentile(values: NDArray[np.floating], share: float) -> float:
    """The value below which a share of values (n,) lies, interpolated linearly as `np.quantile` does; NaN if one is."""
    place = share * (len(values) - 1)
    below, last = int(place), len(values) - 1
    above = min(below + 1, last)
    # A tenth of what `np.quantile` takes for so few values; NaN comes last.
    lower, upper, largest = np.partition(values, (below, above, last))[[below, above, last]].tolist()
    return lower + (upper - lower) * (place - below) if not np.isnan(largest) else largest


@kernel
def compare_shapes(
    vertices: NDArray[np.floating],
    edges: NDArray[np.int32],
    lengths: NDArray[np.floating],
    corners: NDArray[np.int32],
    stretch: NDArray[np.float64],
) -> int:
    """Number of pairs of faces that are folded onto each other.

    Args:
        vertices: deformed ones (n, 3) [m].
        edges, lengths: of the undeformed mesh (k, 2) and (k,) [m].
        corners: of both faces of every pair (p, 6).
        stretch: result, relative change of every edge's length (k,).
    """
    for e in range(edges.shape[0]):
        square = 0.0
        for i in range(3):
            along = np.float64(vertices[edges[e, 0], i]) - np.float64(vertices[edges[e, 1], i])
            square += along * along
        stretch[e] = abs(np.sqrt(square) / lengths[e] - 1)
    folded, normals = 0, np.empty((2, 3))
    for p in range(corners.shape[0]):
        for face in range(2):
            a, b, c = corners[p, 3 * face], corners[p, 3 * face + 1], corners[p, 3 * face + 2]
            x, y, z = np.float64(vertices[a, 0]), np.float64(vertices[a, 1]), np.float64(vertices[a, 2])
            ux, uy, uz = vertices[b, 0] - x, vertices[b, 1] - y, vertices[b, 2] - z
            wx, wy, wz = vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z
            nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
            scale = 1 / max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
            normals[face, 0], normals[face, 1], normals[face, 2] = nx * scale, ny * scale, nz * scale
        cosine = normals[0, 0] * normals[1, 0] + normals[0, 1] * normals[1, 1] + normals[0, 2] * normals[1, 2]
        folded += 1 if cosine < FOLDED_COSINE else 0
    return folded


def _neighbors(faces: NDArray[np.int32]) -> NDArray[np.intp]:
    """Pairs of faces (p, 2) that share an edge."""
    sides = np.sort(sides_of(faces), axis=1)
    order = np.lexsort(sides.T)
    same = np.flatnonzero(np.all(sides[order[1:]] == sides[order[:-1]], axis=1))
    return np.stack([order[same], order[same + 1]], axis=1) % len(faces)
