"""Where a sheet ends: the rim of its mesh against the outline that a depth sensor sees.

Distances say nothing about how a smooth surface slides along itself. Where it ends does: the rim belongs on the line
between the pixels that show the object and those that look past it.
"""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Moves, Surface
from abs_service.tracker.synthesis.perspective import project_with_slopes
from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.window import WHOLE, Window, corner
from abs_service.tracker.terms.linearization import Linearization
from abs_service.tracker.visibility import Visibility
from calib.camera import Camera
from calib.jit import kernel

#: What is farther from the outline than so many deviations says no more about where the rim is: the outline may be that
#: of something else.
FARTHEST = 4.0

#: Beside the object, pixels nearer to it than so many deviations are not held against a vertex: the rim is there.
GRACE = 3.0

#: The object goes on beyond the outermost vertices by no more than so many times their distance from the next ones.
MOST_BEYOND = 2.0


class Outline(Protocol):
    """What the outline says, for one camera."""

    def observe(
        self, distance: NDArray[np.float32], seen: Visibility, predicted: Surface, window: Window = WHOLE
    ) -> NDArray[np.bool_]:
        """Takes what a window of a depth image shows; the pixels beside the object that say nothing else.

        Args:
            distance: measured distances (rows, columns) [m] in the window.
            seen: what they show.
            predicted: where the object is expected, a population of one.
            window: of the image.
        """
        ...

    def cost(self, surface: Surface) -> NDArray[np.float64] | float:
        """Cost (population,) of every deformed mesh."""
        ...

    def linearize(self, surface: Surface, moves: Moves) -> Linearization:
        """Normalised residuals of a population of one and their derivatives, from how the vertices move."""
        ...


class Unknown:
    """The outline of something that does not end at its mesh's rim: it says nothing."""

    def observe(
        self, distance: NDArray[np.float32], seen: Visibility, predicted: Surface, window: Window = WHOLE
    ) -> NDArray[np.bool_]:
        """Nothing."""
        return np.zeros(distance.shape, np.bool_)

    def cost(self, surface: Surface) -> float:
        """Nothing."""
        return 0.0

    def linearize(self, surface: Surface, moves: Moves) -> Linearization:
        """No rows."""
        return Linearization(np.zeros(0), np.zeros((0, moves.dimension)))


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """The outermost vertices of a mesh.

    Attributes:
        outer: their indices (k,); corners, which have no neighbour inside, are left out.
        inner: for each, the nearest vertex (k,) inside that it shares an edge with.
    """

    outer: NDArray[np.intp]
    inner: NDArray[np.intp]

    @classmethod
    def of(cls, mesh: Mesh) -> "Rim":
        """The rim of a mesh: what is on an edge of one face only."""
        sides = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
        edges, count = np.unique(sides, axis=0, return_counts=True)
        outside = np.zeros(len(mesh.vertices), np.bool_)
        outside[edges[count == 1]] = True
        across = np.concatenate([edges, edges[:, ::-1]])
        across = across[outside[across[:, 0]] & ~outside[across[:, 1]]]
        length = np.linalg.norm(mesh.vertices[across[:, 0]] - mesh.vertices[across[:, 1]], axis=1)
        across = across[np.argsort(length, kind="stable")]
        outer, nearest = np.unique(across[:, 0], return_index=True)
        return cls(outer.astype(np.intp), across[nearest, 1].astype(np.intp))


class RimOutline:
    """The rim's distances from the outline are normal with zero mean, and bounded as outliers are.

    A mesh that was made from an image ends up to a cell inside the object. How far the object goes on beyond it is told
    from the first image: from then on, the rim is where the mesh, continued by as much, ends.

    Args:
        camera: the camera.
        rim: outermost vertices.
        deviation: standard deviation of where the outline seems to be [px].
    """

    def __init__(self, camera: Camera, rim: Rim, deviation: float):
        self._camera = camera
        self._projection = Projection(camera)
        self._rim = rim
        self._deviation = deviation
        self._inwards = np.zeros((0, 0), np.float32)
        self._corner = np.zeros(2, np.float32)
        self._beyond = np.zeros(len(rim.outer), np.float32)
        self._begun = False

    def observe(
        self, distance: NDArray[np.float32], seen: Visibility, predicted: Surface, window: Window = WHOLE
    ) -> NDArray[np.bool_]:
        """Takes what a window of a depth image shows; the pixels beside the object that say nothing else."""
        self._inwards = inwards(distance, seen)
        self._corner = np.array(corner(window)[::-1], np.float32)
        if not self._begun:
            self._beyond, self._begun = self._measure(predicted), True
        return (seen.free_m > 0) & (self._inwards > -GRACE * self._deviation)

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        residual = self._look_up(self._points(surface))[0] / self._deviation
        return 0.5 * np.sum(np.minimum(residual**2, FARTHEST**2), axis=1)

    def linearize(self, surface: Surface, moves: Moves) -> Linearization:
        """Residuals of what is near the outline, and their derivatives."""
        points = self._points(surface)
        residual, slopes = (values[0] / self._deviation for values in self._look_up(points))
        use = np.flatnonzero(np.abs(residual) < FARTHEST)
        places = points[0].T[use].astype(np.float64)
        rows = np.einsum("vi,vij->vj", slopes[use], project_with_slopes(self._camera, places)[1])
        ends = self._rim.outer[use], self._rim.inner[use], self._beyond[use]
        jacobian = np.zeros((len(use), moves.dimension))
        _chain(rows, *ends, moves.group, moves.parameters, moves.local, jacobian)
        return Linearization(residual[use], jacobian)

    def _points(self, surface: Surface) -> NDArray[np.float32]:
        """Where the object ends (population, 3, k) [m]."""
        outer, inner = surface.vertices[:, :, self._rim.outer], surface.vertices[:, :, self._rim.inner]
        return np.asarray(outer + self._beyond * (outer - inner), np.float32)

    def _measure(self, predicted: Surface) -> NDArray[np.float32]:
        """How far (k,) the object goes on beyond the rim of the mesh, in distances from the next vertex."""
        outer, inner = (predicted.vertices[0].T[i].astype(np.float64) for i in (self._rim.outer, self._rim.inner))
        steps = self._camera.project(outer) - self._camera.project(inner)
        away, slopes = (values[0] for values in self._look_up(predicted.vertices[:, :, self._rim.outer]))
        per_step = -np.einsum("vi,vi->v", slopes, steps)
        known = per_step > 0
        beyond = np.where(known, np.clip(away / np.where(known, per_step, 1.0), 0.0, MOST_BEYOND), 0.0)
        return beyond.astype(np.float32)

    def _look_up(self, points: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distances inwards (population, k) [px] of points (population, 3, k), and slopes (population, k, 2)."""
        places, inverse_z = self._projection.project(np.ascontiguousarray(points))
        places -= self._corner
        places[np.isnan(inverse_z)] = np.nan
        values, slopes = np.empty(places.shape[:2]), np.empty(places.shape)
        look_up(self._inwards, places.reshape(-1, 2), values.reshape(-1), slopes.reshape(-1, 2))
        return values, slopes


def inwards(distance: NDArray[np.float32], seen: Visibility) -> NDArray[np.float32]:
    """Distance of every pixel (height, width) from the object's outline [px], negative outside it; NaN if unknown.

    What hides the object, and where returns are missing inside it, is unknown: the object may go on there.
    """
    beside = (seen.free_m > 0) | (np.isnan(distance) & ~seen.hole)
    if not (beside.any() and seen.object.any()):
        return np.full(distance.shape, np.nan, np.float32)
    inside, outside = (
        cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for mask in (~beside, beside)
    )
    away = np.where(beside, 0.5 - outside, inside - 0.5).astype(np.float32)
    away[seen.foreground | seen.hole] = np.nan
    return away


@kernel
def look_up(
    image: NDArray[np.float32], places: NDArray[np.floating], values: NDArray[np.float64], slopes: NDArray[np.float64]
) -> None:
    """Values (n,) and slopes (n, 2) of an image at places (n, 2), bilinear; huge and level beyond it and at NaN."""
    height, width = image.shape
    for k in range(places.shape[0]):
        values[k], slopes[k, 0], slopes[k, 1] = 1e9, 0.0, 0.0
        u, v = places[k, 0], places[k, 1]
        if not (u >= 0 and v >= 0 and u < width - 1 and v < height - 1):
            continue
        column, row = int(u), int(v)
        f, g = u - column, v - row
        a, b = image[row, column], image[row, column + 1]
        c, d = image[row + 1, column], image[row + 1, column + 1]
        if np.isnan(a) or np.isnan(b) or np.isnan(c) or np.isnan(d):
            continue
        values[k] = (1 - g) * ((1 - f) * a + f * b) + g * ((1 - f) * c + f * d)
        slopes[k, 0] = (1 - g) * (b - a) + g * (d - c)
        slopes[k, 1] = (1 - f) * (c - a) + f * (d - b)


@kernel
def _chain(
    rows: NDArray[np.float64],
    outer: NDArray[np.intp],
    inner: NDArray[np.intp],
    beyond: NDArray[np.float32],
    group: NDArray[np.int32],
    parameters: NDArray[np.int64],
    local: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """How residuals change with the parameters (k, dim), from how they do with outer + beyond (outer − inner).

    Args:
        rows: derivatives (k, 3) by these points.
        outer, inner, beyond: vertices and share (k,).
        group, parameters, local: as in `Moves`.
        jacobian: zeros before.
    """
    for k in range(rows.shape[0]):
        for end in range(2):
            v, share = (outer[k], 1.0 + beyond[k]) if end == 0 else (inner[k], 0.0 - beyond[k])
            own = parameters[group[v]]
            for d in range(own.size):
                along = rows[k, 0] * local[v, 0, d] + rows[k, 1] * local[v, 1, d] + rows[k, 2] * local[v, 2, d]
                jacobian[k, own[d]] += share * along
