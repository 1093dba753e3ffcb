"""Where a sheet ends: the rim of its mesh against the outline that a depth sensor sees.

Distances say nothing about how a smooth surface slides along itself. Where it ends does: the rim belongs on the line
between the pixels that show the object and those that look past it.
"""

from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.chain import NOTHING, Step
from abs_service.tracker.models.base import Moves, Surface
from abs_service.tracker.synthesis.perspective import project_with_slopes
from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.window import WHOLE, Window, corner
from abs_service.tracker.terms.linearization import Linearization
from abs_service.tracker.terms.rim import FARTHEST, Rim, chain, judge, look_up
from abs_service.tracker.visibility import Visibility
from calib.camera import Camera

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

    def step(self) -> Step:
        """The same for one candidate of a chain."""
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

    def step(self) -> Step:
        """Nothing."""
        return NOTHING

    def linearize(self, surface: Surface, moves: Moves) -> Linearization:
        """No rows."""
        return Linearization(np.zeros(0), np.zeros((0, moves.dimension)))


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

    def step(self) -> Step:
        """The same for one candidate of a chain."""
        looking = *self._projection.arguments, self._corner, self._inwards, self._deviation
        return Step(judge, (self._rim.outer, self._rim.inner, self._beyond, *looking))

    def linearize(self, surface: Surface, moves: Moves) -> Linearization:
        """Residuals of what is near the outline, and their derivatives."""
        points = self._points(surface)
        residual, slopes = (values[0] / self._deviation for values in self._look_up(points))
        use = np.flatnonzero(np.abs(residual) < FARTHEST)
        places = points[0].T[use].astype(np.float64)
        rows = np.einsum("vi,vij->vj", slopes[use], project_with_slopes(self._camera, places)[1])
        ends = self._rim.outer[use], self._rim.inner[use], self._beyond[use]
        jacobian = np.zeros((len(use), moves.dimension))
        chain(rows, *ends, moves.group, moves.parameters, moves.local, jacobian)
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
