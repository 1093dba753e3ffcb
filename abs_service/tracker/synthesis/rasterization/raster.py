"""Distance image of one deformed mesh, with a z-buffer.

This rasteriser is separate from `zbuffer`, which also records each pixel's face for a population, because it needs only
the depth: it takes about half the time, and it interpolates in double precision, so the results differ in the last bit.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.rasterization.zbuffer import extent
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
        place, inverse_z = self._projection.project(np.ascontiguousarray(vertices[None], np.float32))
        self._distance[self._box] = np.inf
        self._nearness[self._box] = 0
        self._box = self._around(place, inverse_z)
        _nearest(place[0], inverse_z[0], self._faces, self._nearness)
        with np.errstate(divide="ignore"):
            np.divide(self._ray_length[self._box], self._nearness[self._box], out=self._distance[self._box])
        return self._distance

    def render_at(
        self, vertices: NDArray[np.float32], rows: NDArray[np.intp], columns: NDArray[np.intp]
    ) -> NDArray[np.float32]:
        """The same distances (k,) [m] at some pixels alone, with rows (k,) and columns (k,) inside the image."""
        place, inverse_z = self._projection.project(np.ascontiguousarray(vertices[None], np.float32))
        order = np.argsort(rows, kind="stable")
        start = np.searchsorted(rows[order], np.arange(len(self._ray_length) + 1))
        nearness = np.zeros(len(rows), np.float32)
        _nearest_at(place[0], inverse_z[0], self._faces, start, order, columns, nearness)
        with np.errstate(divide="ignore"):
            return self._ray_length[rows, columns] / nearness

    def _around(self, place: NDArray[np.float32], inverse_z: NDArray[np.float32]) -> tuple[slice, slice]:
        """Rows and columns in which the projected vertices (1, n, 2) lie."""
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        extent(place, inverse_z, low, high)
        size = np.array(self._ray_length.shape)
        first = np.clip(np.ceil(low), 0, size).astype(int).tolist()
        last = np.clip(np.floor(high) + 1, first, size).astype(int).tolist()
        return np.s_[first[0] : last[0], first[1] : last[1]]


#: Column and row of each corner of a face and 1/z there, and twice the face's area; the latter is 0 if it is unknown.
Corners = tuple[Any, ...]


@kernel
def _corners(place: NDArray[np.float32], inverse_z: NDArray[np.float32], face: NDArray[np.int32]) -> Corners:
    """Corners of a face (3,) of vertices at pixel coordinates (n, 2), with 1/z (n,), NaN where the camera sees none."""
    a, b, c = face
    ax, ay, bx, by = place[a, 0], place[a, 1], place[b, 0], place[b, 1]
    cx, cy = place[c, 0], place[c, 1]
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    area = np.float32(0) if np.isnan(inverse_z[a] + inverse_z[b] + inverse_z[c]) else area
    return ax, ay, inverse_z[a], bx, by, inverse_z[b], cx, cy, inverse_z[c], area


@kernel
def _rows_of(corners: Corners, height: int) -> tuple[int, int]:
    """First and last row of a face in an image of a height; the last is before the first if it covers none."""
    _, ay, _, _, by, _, _, cy, _, area = corners
    if area == 0:
        return 0, -1
    return max(int(np.ceil(min(ay, by, cy))), 0), min(int(np.floor(max(ay, by, cy))), height - 1)


@kernel
def _nearness_in(corners: Corners, row: int, column: int) -> float:
    """1/z of a face at a pixel's centre, 0 beside it; linear in the image (exactly for a pinhole)."""
    ax, ay, near_a, bx, by, near_b, cx, cy, near_c, area = corners
    at_b = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
    at_c = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
    at_a = 1 - at_b - at_c
    return at_a * near_a + at_b * near_b + at_c * near_c if at_a >= 0 and at_b >= 0 and at_c >= 0 else 0.0


@kernel
def _nearest(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    faces: NDArray[np.int32],
    nearness: NDArray[np.float32],
) -> None:
    """Largest 1/z of all faces (m, 3) at every pixel centre (height, width), zeros at the start; see `_corners`."""
    height, width = nearness.shape
    for f in range(faces.shape[0]):
        corners = _corners(place, inverse_z, faces[f])
        first, last = _rows_of(corners, height)
        left = max(int(np.ceil(min(corners[0], corners[3], corners[6]))), 0)
        right = min(int(np.floor(max(corners[0], corners[3], corners[6]))), width - 1)
        for row in range(first, last + 1):
            for column in range(left, right + 1):
                near = np.float32(_nearness_in(corners, row, column))
                nearness[row, column] = max(nearness[row, column], near)


@kernel
def _nearest_at(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    faces: NDArray[np.int32],
    start: NDArray[np.int64],
    order: NDArray[np.int64],
    columns: NDArray[np.int64],
    nearness: NDArray[np.float32],
) -> None:
    """As `_nearest`, at some pixels, of which a row has few.

    Args:
        place, inverse_z, faces: as for `_nearest`.
        start: of every row in `order`, and the number of pixels, (height + 1,).
        order: indices (k,) of the pixels, by rows.
        columns: of the pixels (k,).
        nearness: result (k,), zeros at the start.
    """
    for f in range(faces.shape[0]):
        corners = _corners(place, inverse_z, faces[f])
        first, last = _rows_of(corners, start.size - 1)
        left = np.int64(np.ceil(min(corners[0], corners[3], corners[6])))
        right = np.int64(np.floor(max(corners[0], corners[3], corners[6])))
        for row in range(first, last + 1):
            for at in range(start[row], start[row + 1]):
                pixel = order[at]
                column = int(np.int64(columns[pixel]))  # one form of what is called
                if left <= column <= right:
                    near = np.float32(_nearness_in(corners, row, column))
                    nearness[pixel] = max(nearness[pixel], near)
