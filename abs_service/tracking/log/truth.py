"""Errors of a tracked mesh against ground truth, and their expected size from its covariances."""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

Grid = NDArray[np.float64]

#: Longest interval over which ground truth is interpolated linearly [ns].
MAX_INTERPOLATION_NS = 250_000_000
#: Step below which the closest-point search has converged [grid cells]; about 0.01 mm on a sheet.
TOLERANCE = 1e-3
#: Ground truths kept until their estimates arrive.
MAX_TRUTHS = 256


@dataclass(frozen=True, slots=True)
class Errors:
    """Mean 3-D errors over the vertices.

    Attributes:
        vertex_mm: distance of every vertex from its own material point [mm].
        surface_mm: distance of every vertex from the nearest point of the true surface [mm].
    """

    vertex_mm: float
    surface_mm: float


class TruthComparison:
    """Compares meshes with truth grids of the same moment.

    A vertex belongs to the material point that was nearest to it when the mesh was made. From then on it is compared
    with where that point went (vertex error), and with the surface wherever it is (surface error, never larger).
    Point-set methods look good on the second and poor on the first. Of several surfaces, the mesh belongs to the one
    that it was nearest to when it was made. If the truth of just that moment was lost on the way, the surface was where
    it passed between the truths before and after.
    """

    def __init__(self) -> None:
        self._truths: OrderedDict[int, dict[int, Grid]] = OrderedDict()  # by moment and surface
        self._rest: tuple[int, NDArray[np.float64]] | None = None
        self._material: tuple[int, NDArray[np.float64]] | None = None  # surface, and places on its grid

    def add_topology(self, rest_vertices: NDArray[np.floating], t_host_ns: int) -> None:
        """Takes the undeformed vertices (n, 3) [m] of a mesh that was made from the frames of `t_host_ns`."""
        self._rest, self._material = (t_host_ns, np.asarray(rest_vertices, np.float64)), None

    def add_truth(self, t_host_ns: int, points_r: NDArray[np.floating], surface: int = 0) -> None:
        """Takes the true positions (rows, columns, 3) [m] of a surface's material points at `t_host_ns`."""
        self._truths.setdefault(t_host_ns, {})[surface] = np.asarray(points_r, np.float64)
        while len(self._truths) > MAX_TRUTHS:
            self._truths.popitem(last=False)

    def compare(self, t_host_ns: int, vertices: NDArray[np.floating]) -> Errors | None:
        """Errors of vertices (n, 3) [m]; None where the truth of the moment, or of the mesh's making, is unknown."""
        grid, places = self._own(t_host_ns)
        if grid is None or len(vertices) != len(places):
            return None
        error = np.linalg.norm(vertices - _bilinear(grid, places)[0], axis=1)
        surface = np.linalg.norm(vertices - closest_points(vertices, grid), axis=1)
        return Errors(float(error.mean() * 1e3), float(surface.mean() * 1e3))

    def material_points(self, t_host_ns: int) -> NDArray[np.float64] | None:
        """True positions of the vertices' material points (n, 3) [m]; None where unknown."""
        grid, places = self._own(t_host_ns)
        return None if grid is None else _bilinear(grid, places)[0]

    def _own(self, t_host_ns: int) -> tuple[Grid | None, NDArray[np.float64]]:
        """The grid of the mesh's own surface, None where it is unknown, and the vertices' places (n, 2) on it."""
        if self._material is None and self._rest is not None and (then := self._at(self._rest[0])):
            self._material = _nearest(self._rest[1], then)
        surface, places = self._material or (0, np.empty((0, 2)))
        return self._truths.get(t_host_ns, {}).get(surface) if self._material else None, places

    def _at(self, t_host_ns: int) -> dict[int, Grid]:
        """The surfaces at a moment, on the straight line between those before and after if they are missing."""
        if t_host_ns in self._truths:
            return self._truths[t_host_ns]
        before = max((t for t in self._truths if t < t_host_ns), default=None)
        after = min((t for t in self._truths if t > t_host_ns), default=None)
        if before is None or after is None or after - before > MAX_INTERPOLATION_NS:
            return {}
        share = (t_host_ns - before) / (after - before)
        one, other = self._truths[before], self._truths[after]
        return {surface: (1 - share) * one[surface] + share * other[surface] for surface in one.keys() & other.keys()}


def rms_sigma_mm(covariance_f32: bytes) -> float | None:
    """Root mean square of the vertex errors predicted by the mesh's covariances [mm]; None without covariances.

    Args:
        covariance_f32: six numbers [m²] per vertex, as in `DeformedMesh`.
    """
    entries = np.frombuffer(covariance_f32, "<f4").reshape(-1, 6)
    return float(np.sqrt(entries[:, [0, 3, 5]].sum(axis=1).mean()) * 1e3) if len(entries) else None


def closest_points(vertices: NDArray[np.floating], grid: Grid) -> NDArray[np.float64]:
    """Nearest points (n, 3) of the bilinear surface through a grid (rows, columns, 3)."""
    return _bilinear(grid, _closest_parameters(np.asarray(vertices, np.float64), grid))[0]


def _nearest(vertices: NDArray[np.float64], grids: Mapping[int, Grid]) -> tuple[int, NDArray[np.float64]]:
    """The surface that vertices (n, 3) are nearest to, and their places (n, 2) on its grid."""
    places = {surface: _closest_parameters(vertices, grid) for surface, grid in grids.items()}

    def away(surface: int) -> float:
        points = _bilinear(grids[surface], places[surface])[0]
        return float(np.linalg.norm(vertices - points, axis=1).mean())

    nearest = min(grids, key=away)
    return nearest, places[nearest]


def _closest_parameters(vertices: NDArray[np.float64], grid: Grid) -> NDArray[np.float64]:
    """Grid coordinates (n, 2) = (row, column) of the nearest surface points, by Gauss–Newton from the nearest node."""
    rows, columns = grid.shape[:2]
    nearest = scipy.spatial.KDTree(grid.reshape(-1, 3)).query(vertices)[1]
    place = np.stack(np.unravel_index(nearest, (rows, columns)), axis=1).astype(np.float64)
    moving = np.arange(len(place))
    for _ in range(8):
        points, tangents = _bilinear(grid, place[moving])
        normal_matrix = np.einsum("nij,nik->njk", tangents, tangents)
        gradient = np.einsum("nij,ni->nj", tangents, vertices[moving] - points)
        step = np.linalg.solve(normal_matrix, gradient[..., None])[..., 0]
        before = place[moving]
        place[moving] = np.clip(before + np.clip(step, -1, 1), 0, (rows - 1, columns - 1))
        moving = moving[np.abs(place[moving] - before).max(axis=1) > TOLERANCE]
        if not len(moving):
            break
    return place


def _bilinear(grid: Grid, place: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 3) and tangents (n, 3, 2) by row and column."""
    rows, columns = grid.shape[:2]
    cell = np.minimum(place.astype(int), (rows - 2, columns - 2))
    (i, j), (f, g) = cell.T, (place - cell).T[:, :, None]
    a, b, c, d = grid[i, j], grid[i, j + 1], grid[i + 1, j], grid[i + 1, j + 1]
    points = (1 - f) * ((1 - g) * a + g * b) + f * ((1 - g) * c + g * d)
    along_row = (1 - g) * (c - a) + g * (d - b)
    along_column = (1 - f) * (b - a) + f * (d - c)
    return points, np.stack([along_row, along_column], axis=-1)
