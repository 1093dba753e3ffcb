"""Outline of a sheet: the rim of its mesh compared with the outline in a depth image.

Distances do not constrain a smooth surface that slides along itself; its outline does. The rim belongs on the line
between the pixels on the object and those beside it.
"""

from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.perspective import project_with_slopes
from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.window import WHOLE, Window, corner
from abs_service.tracker.terms.depth.rim import FARTHEST, Rim, chain, locate, outline_cost
from abs_service.tracker.terms.depth.visibility import Visibility
from abs_service.tracker.terms.linearization import Linearization
from calib.camera import Camera

#: Beside the object, pixels nearer to it than so many deviations are not held against a vertex: the rim is there.
GRACE = 3.0

#: The object goes on beyond the outermost vertices by no more than so many times their distance from the next ones.
MOST_BEYOND = 2.0


#: Outer and inner vertices and share of a rim, and what `projection.project` takes of a camera.
Ends = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]
Optics = tuple[bool, NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], float]


class Outline(Protocol):
    """Cost of the outline in one camera."""

    def observe(
        self, distance: NDArray[np.float32], seen: Visibility, predicted: Surface, window: Window = WHOLE
    ) -> NDArray[np.bool_]:
        """Sets the outline from a window of a depth image.

        Args:
            distance: measured distances (rows, columns) [m] in the window.
            seen: their classification.
            predicted: predicted surface, a population of one.
            window: of the image.

        Returns:
            Mask (rows, columns) of the pixels beside the object that serve for the outline only.
        """
        ...

    def cost(self, surface: Surface) -> NDArray[np.float64] | float:
        """Cost (population,) of every deformed mesh."""
        ...

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """Normalised residuals of a population of one and their derivatives with respect to theta."""
        ...


class Unknown:
    """Null object for bodies without an outline at the mesh's rim: zero cost."""

    def observe(
        self, distance: NDArray[np.float32], seen: Visibility, predicted: Surface, window: Window = WHOLE
    ) -> NDArray[np.bool_]:
        """Empty mask."""
        return np.zeros(distance.shape, np.bool_)

    def cost(self, surface: Surface) -> float:
        """Zero."""
        return 0.0

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """No rows."""
        return Linearization(np.zeros(0), np.zeros((0, sparse_jacobian.dimension)))


class RimOutline:
    """The rim's distances from the outline are normal with zero mean, and bounded as outliers are.

    A mesh made from an image ends up to one cell inside the object. The gap is measured in the first image; from then
    on, the rim is that of the mesh extrapolated by this gap.

    Args:
        camera: the camera.
        rim: outermost vertices.
        deviation: standard deviation of the position of the outline [px].
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
        """Sets the outline from a window of a depth image; the mask of pixels that serve for the outline only."""
        part, self._inwards = inwards(distance, seen, int(np.ceil(FARTHEST * self._deviation)) + 1)
        self._corner = np.add(corner(window), corner(part))[::-1].astype(np.float32)
        if not self._begun:
            self._beyond, self._begun = self._measure(predicted), True
        beside = np.zeros(distance.shape, np.bool_)
        beside[part] = (seen.free_m[part] > 0) & (self._inwards > -GRACE * self._deviation)
        return beside

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        out = np.empty(len(surface.vertices))
        outline_cost(surface.vertices, self._deviation, *self._arguments, out)
        return out

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """Normalised residuals of the rim near the outline, and their derivatives with respect to theta."""
        points, values, slopes = self._locate(surface)
        residual = values / self._deviation
        use = np.flatnonzero(np.abs(residual) < FARTHEST)
        by_place = project_with_slopes(self._camera, points[use].astype(np.float64))[1]
        rows = np.einsum("vi,vij->vj", slopes[use] / self._deviation, by_place)
        ends = self._rim.outer[use], self._rim.inner[use], self._beyond[use]
        jacobian = np.zeros((len(use), sparse_jacobian.dimension))
        chain(rows, *ends, sparse_jacobian.group, sparse_jacobian.parameters, sparse_jacobian.local, jacobian)
        return Linearization(residual[use], jacobian)

    @property
    def _arguments(self) -> tuple[*Ends, *Optics, NDArray[np.float32], NDArray[np.float32]]:
        """Arguments of `locate` between the vertices and the results."""
        ends = self._rim.outer, self._rim.inner, self._beyond
        return *ends, *self._projection.arguments, self._corner, self._inwards

    def _locate(self, surface: Surface) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
        """Extrapolated rim (k, 3) [m], its distances inside the outline (k,) [px], and their image gradients (k, 2)."""
        k = len(self._beyond)
        points, values, slopes = np.empty((1, 3, k), np.float32), np.empty(k), np.empty((k, 2))
        locate(surface.vertices, *self._arguments, points, values, slopes)
        return points[0].T, values, slopes

    def _measure(self, predicted: Surface) -> NDArray[np.float32]:
        """Gap (k,) between the mesh's rim and the end of the object, relative to the distance from the inner vertex."""
        outer, away, slopes = self._locate(predicted)
        inner = predicted.vertices[0].T[self._rim.inner]
        steps = self._camera.project(outer.astype(np.float64)) - self._camera.project(inner.astype(np.float64))
        per_step = -np.einsum("vi,vi->v", slopes, steps)
        known = per_step > 0
        beyond = np.where(known, np.clip(away / np.where(known, per_step, 1.0), 0.0, MOST_BEYOND), 0.0)
        return beyond.astype(np.float32)


def _around(mask: NDArray[np.bool_], reach: int) -> Window:
    """Rows and columns within so many pixels of those of a mask (height, width), which is not empty."""
    axes = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    rows, columns = (slice(max(int(at[0]) - reach, 0), int(at[-1]) + reach + 1) for at in axes)
    return rows, columns


def inwards(distance: NDArray[np.float32], seen: Visibility, reach: int) -> tuple[Window, NDArray[np.float32]]:
    """Distance of pixels from the object's outline [px], negative outside it; NaN if unknown.

    Occluders and holes are unknown: the object may continue there.

    Args:
        distance, seen: an image (height, width) [m], and what it shows.
        reach: pixels outside the object up to which distances are needed [px].

    Returns:
        The part of the image that is not farther outside, and the distances there (rows, columns).
    """
    beside = (seen.free_m > 0) | (np.isnan(distance) & ~seen.hole)
    if not (beside.any() and seen.object.any()):
        return WHOLE, np.full(distance.shape, np.nan, np.float32)
    part = _around(~beside, reach)
    outside = beside[part]
    to_inside, to_outside = (
        cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for mask in (outside, ~outside)
    )
    away = np.where(outside, 0.5 - to_inside, to_outside - 0.5).astype(np.float32)
    away[seen.foreground[part] | seen.hole[part]] = np.nan
    return part, away
