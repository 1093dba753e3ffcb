"""Measured surface of the object beside its mesh: what a mesh leaves unexplained, on a coarse grid of pixels."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window, limits
from abs_service.tracker.mesh import Mesh, edge_lengths
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.sensor_fit import Remainder
from calib.camera import Camera
from calib.jit import kernel

#: About how many columns the grid has.
COLUMNS = 80

#: Surface farther beside the mesh than this share of its side, if it were square, is not counted: it may be anything.
MAX_REACH = 0.25


class Continuation:
    """The measured surface that is continuous with the object in one camera's images, by every few pixels in a row.

    A mesh made from an image ends up to one cell inside the object, so pixels as near as that do not count.
    """

    def __init__(self, camera: Camera, mesh: Mesh):
        self._step = max(camera.width // COLUMNS, 1)
        few = _every(camera, self._step)
        self._raster = Raster(few, mesh.faces)
        self._shape = few.height, few.width
        self._focal = camera.fx / self._step
        self._gap_m = float(np.median(edge_lengths(mesh.vertices, mesh.edges)))
        self._reach_m = MAX_REACH * float(np.sqrt(mesh.area)) + self._gap_m
        self._at_first = float("nan")

    def observe(self, shown: NDArray[np.bool_], window: Window = WHOLE) -> Callable[[Surface], Remainder]:
        """Surface in one image that a population of one leaves unexplained.

        Args:
            shown: pixels (rows, columns) in the window that show the object.
            window: of the image.
        """
        rows, columns = self._shape
        top, _, left, _ = limits(window, (rows * self._step, columns * self._step))
        few = shown[-top % self._step :: self._step, -left % self._step :: self._step]
        row, column = -(-top // self._step), -(-left // self._step)
        whole = np.zeros(self._shape, np.bool_)
        whole[row : row + few.shape[0], column : column + few.shape[1]] = few
        return partial(self._remainder, whole)

    def _remainder(self, shown: NDArray[np.bool_], surface: Surface) -> Remainder:
        """Share of the object's pixels that lie beside a population of one, now and the first time."""
        share = self._share(shown, surface)
        self._at_first = share if np.isnan(self._at_first) else self._at_first
        return Remainder(share, self._at_first)

    def _share(self, shown: NDArray[np.bool_], surface: Surface) -> float:
        """Share of the pixels beside the mesh in those and the ones on it; NaN without any."""
        distance = self._raster.render(surface.vertices[0])
        off = np.empty(distance.shape, np.uint8)
        explained, mean_m = find_explained(distance, shown, off)
        if not explained:
            return float("nan")
        pixel_m = mean_m / self._focal
        away = np.asarray(cv2.distanceTransform(off, cv2.DIST_L2, cv2.DIST_MASK_3), np.float32)
        left = count_within(away, shown, max(self._gap_m / pixel_m, 1.0), self._reach_m / pixel_m)
        return left / (left + explained)


@kernel
def find_explained(
    distance: NDArray[np.float32], shown: NDArray[np.bool_], off: NDArray[np.uint8]
) -> tuple[int, float]:
    """Number of pixels (rows, columns) on the mesh that show the object, and mean distance of those on the mesh [m].

    Args:
        distance: of the mesh [m], infinite off it.
        shown: pixels that show the object.
        off: result, 1 off the mesh, else 0.
    """
    explained, on_mesh, total = 0, 0, 0.0
    for row in range(distance.shape[0]):
        for column in range(distance.shape[1]):
            is_on = np.isfinite(distance[row, column])
            off[row, column] = 0 if is_on else 1
            if is_on:
                total += distance[row, column]
                on_mesh += 1
                explained += 1 if shown[row, column] else 0
    return explained, total / on_mesh


@kernel
def count_within(away: NDArray[np.float32], shown: NDArray[np.bool_], minimum: float, maximum: float) -> int:
    """Number of pixels (rows, columns) that show the object, farther from the mesh than a distance, up to another."""
    count = 0
    for row in range(away.shape[0]):
        for column in range(away.shape[1]):
            count += 1 if shown[row, column] and minimum < away[row, column] <= maximum else 0
    return count


def _every(camera: Camera, step: int) -> Camera:
    """The camera of an image of every few pixels, from the first one on."""
    size = {"width": -(-camera.width // step), "height": -(-camera.height // step)}
    matrix = {name: getattr(camera, name) / step for name in ("fx", "fy", "cx", "cy")}
    return replace(camera, **size, **matrix)
