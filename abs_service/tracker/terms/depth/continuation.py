"""Measured surface of the object beside its mesh: what a mesh leaves unexplained, on a coarse grid of pixels."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Protocol

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

#: About how many columns the grid has.
COLUMNS = 80

#: Surface farther beside the mesh than this share of its side, if it were square, is not counted: it may be anything.
MAX_REACH = 0.25


class Continuation(Protocol):
    """The measured surface that is continuous with the object in one camera's images."""

    def observe(self, shown: NDArray[np.bool_], window: Window = WHOLE) -> Callable[[Surface], Remainder]:
        """Surface in one image that a population of one leaves unexplained.

        Args:
            shown: pixels (rows, columns) in the window that show the object.
            window: of the image.
        """
        ...


class NoContinuation:
    """Null object: the share is unknown."""

    def observe(self, shown: NDArray[np.bool_], window: Window = WHOLE) -> Callable[[Surface], Remainder]:
        """Unknown for every surface."""
        return lambda surface: Remainder()


class CoarseContinuation:
    """Pixels of the object beside the mesh, of every few in a row.

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
        """See `Continuation`; of every few pixels."""
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
        on_mesh = np.isfinite(distance)
        explained = int(np.count_nonzero(on_mesh & shown))
        if not explained:
            return float("nan")
        pixel_m = float(distance[on_mesh].mean()) / self._focal
        away_m = pixel_m * cv2.distanceTransform((~on_mesh).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
        beside = shown & (away_m > max(self._gap_m, pixel_m)) & (away_m <= self._reach_m)
        left = int(np.count_nonzero(beside))
        return left / (left + explained)


def _every(camera: Camera, step: int) -> Camera:
    """The camera of an image of every few pixels, from the first one on."""
    size = {"width": -(-camera.width // step), "height": -(-camera.height // step)}
    matrix = {name: getattr(camera, name) / step for name in ("fx", "fy", "cx", "cy")}
    return replace(camera, **size, **matrix)
