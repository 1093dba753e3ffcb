"""Distance image of one deformed mesh, with a z-buffer.

`zbuffer` also records each pixel's face, for a population. This needs only the depth, and takes about half the time.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Projected, Projection, extent
from abs_service.tracker.synthesis.rasterization.face_in_image import face_in_image
from calib.camera import Camera
from calib.jit import kernel
from calib.warp.triangle import Triangle, columns_of, rows_of, weights_at


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


class Plane(NamedTuple):
    """1/z of a face, linear in the image (exactly for a pinhole).

    Attributes:
        at: the face.
        per_area: 1 / area.
        near_a, near_b, near_c: of the corners.
    """

    at: Triangle
    per_area: np.float64
    near_a: np.float32
    near_b: np.float32
    near_c: np.float32


@kernel
def _plane(seen: Projected, face: NDArray[np.int32]) -> tuple[Plane, bool]:
    """The plane of a face (3,) of a population of one, and whether the camera sees all corners."""
    at, near_a, near_b, near_c = face_in_image(seen, 0, face)
    is_seen = not np.isnan(near_a + near_b + near_c) and at.area != 0
    return Plane(at, 1 / np.float64(at.area), near_a, near_b, near_c), is_seen


@kernel
def _nearness_in(plane: Plane, row: int, column: int) -> np.floating | float:
    """1/z of a face at a pixel's centre, 0 beside it."""
    of_b, of_c = weights_at(plane.at, plane.per_area, np.float64(row), np.float64(column))
    of_a = 1 - of_b - of_c
    inside = of_a >= 0 and of_b >= 0 and of_c >= 0
    return of_a * plane.near_a + of_b * plane.near_b + of_c * plane.near_c if inside else 0.0


@kernel
def _nearest(seen: Projected, faces: NDArray[np.int32], nearness: NDArray[np.float32]) -> None:
    """Largest 1/z of all faces (m, 3) of a population of one at every pixel (height, width), zeros at the start."""
    height, width = nearness.shape
    for f in range(faces.shape[0]):
        plane, is_seen = _plane(seen, faces[f])
        if not is_seen:
            continue
        (highest, lowest), (leftmost, rightmost) = rows_of(plane.at), columns_of(plane.at)
        left, right = max(int(np.ceil(leftmost)), 0), min(int(np.floor(rightmost)), width - 1)
        for row in range(max(int(np.ceil(highest)), 0), min(int(np.floor(lowest)), height - 1) + 1):
            for column in range(left, right + 1):
                near = np.float32(_nearness_in(plane, row, column))
                nearness[row, column] = max(nearness[row, column], near)


@kernel
def _nearest_at(seen: Projected, faces: NDArray[np.int32], few: FewPixels, nearness: NDArray[np.float32]) -> None:
    """Writes the nearest surface at some pixels (k,); see `_nearest`."""
    height = few.start.size - 1
    for f in range(faces.shape[0]):
        plane, is_seen = _plane(seen, faces[f])
        if not is_seen:
            continue
        (highest, lowest), (left, right) = rows_of(plane.at), columns_of(plane.at)
        for row in range(max(int(np.ceil(highest)), 0), min(int(np.floor(lowest)), height - 1) + 1):
            for k in range(few.start[row], few.start[row + 1]):
                pixel = few.order[k]
                column = int(np.int64(few.columns[pixel]))  # one form of what is called
                if left <= column <= right:
                    near = np.float32(_nearness_in(plane, row, column))
                    nearness[pixel] = max(nearness[pixel], near)
