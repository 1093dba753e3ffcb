"""The triangle mesh that is deformed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from calib.jit import kernel

Float = TypeVar("Float", bound=np.floating)


@dataclass(frozen=True, eq=False)
class Mesh:
    """An undeformed triangle mesh V in rig coordinates.

    Attributes:
        vertices: positions (n, 3) [m].
        faces: vertex indices (m, 3), counter-clockwise seen from outside.
        colors: red, green, blue (n, 3) in 0…255 from a colour sensor; NaN where none saw the vertex.
        chart: flat coordinates (n, 2) of the vertices, in any unit, in which the mesh does not fold; first axis along
            the object's long side.
        appearance: by imaging sensor, values (k, channels) in the sensor's unit; with active illumination, per unit of
            light. At the points of the synthesis, mostly the vertices; NaN where unknown.
        deviation: standard deviation (n,) [m] of the vertices along their normals, from the noise of the measurement
            that they were made from; one number () if it is the same for all.
        pixel_deviation: standard deviation of a single distance of the object by the noise model of the sensor that
            measured it, median [m]; 0 if unknown.
        is_complete: True if the mesh ends where the object does, as that of a template; one made from an image ends a
            little before.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    colors: NDArray[np.float32]
    chart: NDArray[np.float64]
    appearance: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    deviation: NDArray[np.float64] = field(default_factory=lambda: np.zeros(()))
    is_complete: bool = False
    pixel_deviation: float = 0.0

    def appearance_of(self, sensor: str) -> NDArray[np.float32]:
        """Appearance in a sensor at the points of its synthesis; defaults to the vertices' colours."""
        return self.appearance.get(sensor, self.colors)

    @cached_property
    def edges(self) -> NDArray[np.int32]:
        """Vertex indices (k, 2) of every edge once."""
        return edges_of(self.faces)[0]

    @property
    def area(self) -> float:
        """Area of the surface [m²]."""
        return float(np.linalg.norm(area_vectors(self.vertices, self.faces), axis=1).sum() / 2)

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit vertex normals (n, 3), the area-weighted mean of the adjacent faces' normals."""
        face_normals = area_vectors(self.vertices, self.faces)
        corners, n = self.faces.T.ravel(), len(self.vertices)
        sums = [np.bincount(corners, np.tile(column, 3), n) for column in face_normals.T]
        return unit(np.stack(sums, axis=1).astype(np.float64, copy=False))

    def reordered(self, order: NDArray[np.integer]) -> "Mesh":
        """The same mesh with its vertices listed in another order: vertex i becomes the former vertex order[i]."""
        place = np.empty(len(order), np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        appearance = {sensor: values[order] for sensor, values in self.appearance.items()}
        deviation = np.broadcast_to(self.deviation, len(order))[order]
        ordered = self.vertices[order], place[self.faces], self.colors[order], self.chart[order]
        return Mesh(*ordered, appearance, deviation, self.is_complete, self.pixel_deviation)


def sides_of(faces: NDArray[np.integer]) -> NDArray[np.int32]:
    """Vertex indices (3 m, 2) of the directed sides of faces (m, 3)."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int32, copy=False)


def edges_of(faces: NDArray[np.integer]) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """Vertex indices (k, 2) of every edge of faces (m, 3) once, in order, and the number (k,) of its faces."""
    sides = np.sort(sides_of(faces), axis=1).astype(np.int64)
    # As single numbers: NumPy sorts rows ten times as slowly.
    count = int(sides.max(initial=0)) + 1
    keys, belongs = np.unique(sides[:, 0] * count + sides[:, 1], return_counts=True)
    return np.stack(np.divmod(keys, count), axis=1).astype(np.int32), belongs


def pieces_of(faces: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Number (m,) of the connected piece of each of the faces (m, 3), and the number of vertices (k,) of each piece."""
    used, corners = np.unique(faces, return_inverse=True)
    corners = corners.reshape(-1, 3)
    links = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]]]).T
    graph = scipy.sparse.coo_array((np.ones(links.shape[1]), links), shape=(len(used), len(used)))
    count, piece = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return piece[corners[:, 0]], np.bincount(piece, minlength=count)


def mean_around(mesh: Mesh) -> "scipy.sparse.csr_array":
    """Matrix (n, n) of the mean over each vertex and its neighbours."""
    n, edges = len(mesh.vertices), mesh.edges
    rows, columns = np.concatenate([edges, edges[:, ::-1], np.tile(np.arange(n)[:, None], 2)]).T
    ring = scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    return scipy.sparse.csr_array(scipy.sparse.diags_array(1 / ring.sum(axis=1)) @ ring)


def ring_means(mean: "scipy.sparse.csr_array", values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product (n,) of `mean_around` and values (n,); SciPy's takes several times as long for some hundred vertices."""
    result = np.empty(len(values))
    _sum_rings(mean.indptr, mean.indices, mean.data, values, result)
    return result


def area_vectors(vertices: NDArray[np.floating], faces: NDArray[np.int32]) -> NDArray[np.floating]:
    """Normals (m, 3) of the faces (m, 3) of vertices (n, 3) [m], as long as twice their area [m²]."""
    corner = vertices[faces[:, 0]]
    (a, b, c), (d, e, f) = (vertices[faces[:, 1]] - corner).T, (vertices[faces[:, 2]] - corner).T
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=1)


@kernel
def _sum_rings(
    start: NDArray[np.int32],
    around: NDArray[np.int32],
    weights: NDArray[np.float64],
    values: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Product of a sparse matrix with values (n,): entries (k,) by rows, which begin at `start` (n + 1,)."""
    for v in range(result.size):
        total = 0.0
        for k in range(start[v], start[v + 1]):
            total += weights[k] * values[around[k]]
        result[v] = total


def unit(vectors: NDArray[Float]) -> NDArray[Float]:
    """Vectors (n, 3) of length 1 in the same directions; those without length stay so."""
    lengths = np.maximum(np.sqrt(np.vecdot(vectors, vectors)), 1e-12)  # half the time of a norm along an axis
    return np.asarray(vectors / lengths[:, None], vectors.dtype)


def edge_lengths(vertices: NDArray[np.floating], edges: NDArray[np.int32]) -> NDArray[np.floating]:
    """Lengths (k,) [m] of the edges (k, 2) of vertices (n, 3) [m]."""
    along = vertices.take(edges[:, 0], axis=0) - vertices.take(edges[:, 1], axis=0)
    return np.sqrt(np.vecdot(along, along))  # a norm along an axis takes twice as long
