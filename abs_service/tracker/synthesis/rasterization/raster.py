"""Distance image of one deformed mesh, with a z-buffer.

This rasteriser is separate from `zbuffer`, which also records each pixel's face for a population, because it needs only
the depth: it takes about half the time, and it interpolates in double precision, so the results differ in the last bit.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Projected, Projection, extent
from calib.camera import Camera
from calib.jit import kernel


class Raster:
    """Renders meshes with the same faces into one camera, forward distortion included.

    Corners are projected exactly; between them a triangle is flat in the distorted image. Only what lies around the
    mesh is touched: a large image costs no more than a small one in which the mesh is as large.
    """

    def __init__(self, camera: Camera, faces: NDArray[np.int32]):
        self._projection = Projection(camera)
        self._faces = np.ascontiguousarray(faces, np.int32)
        self._ray_length = camera.lookup.ray_length.astype(np.float32)
        self._nearness = np.zeros(self._ray_length.shape, np.float32)
        self._distance = np.full(self._ray_length.shape, np.float32(np.inf))
        self._box = np.s_[0:0, 0:0]

    def render(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a mesh with vertices (3, n) [m]; infinite off the mesh.

        The image is valid until the next one is rendered.
        """
        seen = self._projection.project(np.ascontiguousarray(vertices[None], np.float32))
        self._distance[self._box] = np.inf
        self._nearness[self._box] = 0
        self._box = self._around(seen)
        _nearest(seen, self._faces, self._nearness)
        with np.errstate(divide="ignore"):
            np.divide(self._ray_length[self._box], self._nearness[self._box], out=self._distance[self._box])
        return self._distance

    def render_at(
        self, vertices: NDArray[np.float32], rows: NDArray[np.intp], columns: NDArray[np.intp]
    ) -> NDArray[np.float32]:
        """The same distances (k,) [m] at some pixels alone, with rows (k,) and columns (k,) inside the image."""
        seen = self._projection.project(np.ascontiguousarray(vertices[None], np.float32))
        order = np.argsort(rows, kind="stable")
        start = np.searchsorted(rows[order], np.arange(len(self._ray_length) + 1))
        nearness = np.zeros(len(rows), np.float32)
        _nearest_at(seen, self._faces, FewPixels(start, order, columns), nearness)
        with np.errstate(divide="ignore"):
            return self._ray_length[rows, columns] / nearness

    def _around(self, seen: Projected) -> tuple[slice, slice]:
        """Rows and columns in which the vertices of a population of one lie."""
        low, high = (place.tolist() for place in extent(seen))
        rows, columns = map(_whole, low, high, self._ray_length.shape)
        return rows, columns


def _whole(low: float, high: float, size: int) -> slice:
    """Whole numbers from one to another, of those from 0 up to a size."""
    return slice(math.ceil(min(max(low, 0), size)), math.floor(min(max(high, -1), size - 1)) + 1)


class FewPixels(NamedTuple):
    """Pixels of an image of which a row has few.

    Attributes:
        start: of every row in `order`, and the number of pixels, (height + 1,).
        order: indices (k,) of the pixels, by rows.
        columns: of the pixels (k,).
    """

    start: NDArray[np.int64]
    order: NDArray[np.int64]
    columns: NDArray[np.int64]


class Corners(NamedTuple):
    """Corners a, b and c of a face in the image.

    Attributes:
        ax, ay, bx, by, cx, cy: columns and rows.
        near_a, near_b, near_c: 1/z.
        area: twice the face's area; 0 if the camera does not see all corners.
    """

    ax: np.float32
    ay: np.float32
    near_a: np.float32
    bx: np.float32
    by: np.float32
    near_b: np.float32
    cx: np.float32
    cy: np.float32
    near_c: np.float32
    area: np.float32


@kernel
def _corners(seen: Projected, face: NDArray[np.int32]) -> Corners:
    """Corners of a face (3,) of a population of one."""
    a, b, c = face
    place, inverse_z = seen.place[0], seen.inverse_z[0]
    ax, ay, bx, by = place[a, 0], place[a, 1], place[b, 0], place[b, 1]
    cx, cy = place[c, 0], place[c, 1]
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    area = np.float32(0) if np.isnan(inverse_z[a] + inverse_z[b] + inverse_z[c]) else area
    return Corners(ax, ay, inverse_z[a], bx, by, inverse_z[b], cx, cy, inverse_z[c], area)


@kernel
def _rows_of(at: Corners, height: int) -> tuple[int, int]:
    """First and last row of a face in an image of a height; the last is before the first if it covers none."""
    if at.area == 0:
        return 0, -1
    return max(int(np.ceil(min(at.ay, at.by, at.cy))), 0), min(int(np.floor(max(at.ay, at.by, at.cy))), height - 1)


@kernel
def _nearness_in(at: Corners, row: int, column: int) -> np.floating | float:
    """1/z of a face at a pixel's centre, 0 beside it; linear in the image (exactly for a pinhole)."""
    of_b = ((column - at.ax) * (at.cy - at.ay) - (row - at.ay) * (at.cx - at.ax)) / at.area
    of_c = ((at.bx - at.ax) * (row - at.ay) - (at.by - at.ay) * (column - at.ax)) / at.area
    of_a = 1 - of_b - of_c
    return of_a * at.near_a + of_b * at.near_b + of_c * at.near_c if of_a >= 0 and of_b >= 0 and of_c >= 0 else 0.0


@kernel
def _nearest(seen: Projected, faces: NDArray[np.int32], nearness: NDArray[np.float32]) -> None:
    """Largest 1/z of all faces (m, 3) of a population of one at every pixel (height, width), zeros at the start."""
    height, width = nearness.shape
    for f in range(faces.shape[0]):
        at = _corners(seen, faces[f])
        first, last = _rows_of(at, height)
        left = max(int(np.ceil(min(at.ax, at.bx, at.cx))), 0)
        right = min(int(np.floor(max(at.ax, at.bx, at.cx))), width - 1)
        for row in range(first, last + 1):
            for column in range(left, right + 1):
                near = np.float32(_nearness_in(at, row, column))
                nearness[row, column] = max(nearness[row, column], near)


@kernel
def _nearest_at(seen: Projected, faces: NDArray[np.int32], few: FewPixels, nearness: NDArray[np.float32]) -> None:
    """As `_nearest`, at some pixels (k,)."""
    for f in range(faces.shape[0]):
        at = _corners(seen, faces[f])
        first, last = _rows_of(at, few.start.size - 1)
        left = np.int64(np.ceil(min(at.ax, at.bx, at.cx)))
        right = np.int64(np.floor(max(at.ax, at.bx, at.cx)))
        for row in range(first, last + 1):
            for k in range(few.start[row], few.start[row + 1]):
                pixel = few.order[k]
                column = int(np.int64(few.columns[pixel]))  # one form of what is called
                if left <= column <= right:
                    near = np.float32(_nearness_in(at, row, column))
                    nearness[pixel] = max(nearness[pixel], near)
