"""Distance image of one deformed mesh, with a z-buffer.

This rasteriser is separate from `zbuffer`, which also records each pixel's face for a population, because it needs only
the depth: it takes about half the time, and it interpolates in double precision, so the results differ in the last bit.
"""

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
        self._unwanted = np.full(self._ray_length.shape, np.float32(np.inf))
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
        nearness = self._unwanted
        nearness[rows, columns] = 0
        _nearest(place[0], inverse_z[0], self._faces, nearness)
        with np.errstate(divide="ignore"):
            distance = self._ray_length[rows, columns] / nearness[rows, columns]
        nearness[rows, columns] = np.inf
        return distance

    def _around(self, place: NDArray[np.float32], inverse_z: NDArray[np.float32]) -> tuple[slice, slice]:
        """Rows and columns in which the projected vertices (1, n, 2) lie."""
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        extent(place, inverse_z, low, high)
        size = np.array(self._ray_length.shape)
        first = np.clip(np.ceil(low), 0, size).astype(int).tolist()
        last = np.clip(np.floor(high) + 1, first, size).astype(int).tolist()
        return np.s_[first[0] : last[0], first[1] : last[1]]


@kernel
def _nearest(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    faces: NDArray[np.int32],
    nearness: NDArray[np.float32],
) -> None:
    """Largest 1/z of all faces at every pixel centre (height, width).

    Args:
        place: pixel coordinates (n, 2) of the vertices.
        inverse_z: their 1/z (n,), NaN where the camera cannot see them; linear in the image (exactly for a pinhole).
        faces: vertex indices (m, 3).
        nearness: result, at the start zeros where the mesh may be; pixels that are infinite are passed over.
    """
    height, width = nearness.shape
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if np.isnan(inverse_z[a] + inverse_z[b] + inverse_z[c]):
            continue
        ax, ay, bx, by = place[a, 0], place[a, 1], place[b, 0], place[b, 1]
        cx, cy = place[c, 0], place[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        first_row = max(int(np.ceil(min(ay, by, cy))), 0)
        last_row = min(int(np.floor(max(ay, by, cy))), height - 1)
        first_column = max(int(np.ceil(min(ax, bx, cx))), 0)
        last_column = min(int(np.floor(max(ax, bx, cx))), width - 1)
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                if nearness[row, column] == np.inf:
                    continue
                at_b = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
                at_c = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
                at_a = 1 - at_b - at_c
                if at_a >= 0 and at_b >= 0 and at_c >= 0:
                    near = at_a * inverse_z[a] + at_b * inverse_z[b] + at_c * inverse_z[c]
                    nearness[row, column] = max(nearness[row, column], near)
