"""Distance image of one deformed mesh, with a z-buffer.

This rasteriser is separate from `zbuffer`, which also records each pixel's face for a population, because it needs only
the depth: it takes about half the time, and it interpolates in double precision, so the results differ in the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Projection
from calib.camera import Camera
from calib.jit import kernel


class Raster:
    """Renders meshes with the same faces into one camera, forward distortion included.

    Corners are projected exactly; between them a triangle is flat in the distorted image.
    """

    def __init__(self, camera: Camera, faces: NDArray[np.int32]):
        self._projection = Projection(camera)
        self._faces = np.ascontiguousarray(faces, np.int32)
        self._ray_length = camera.lookup.ray_length.astype(np.float32)

    def render(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a mesh with vertices (3, n) [m]; infinite off the mesh."""
        place, inverse_z = self._projection.project(np.ascontiguousarray(vertices[None], np.float32))
        nearness = np.zeros(self._ray_length.shape, np.float32)
        _nearest(place[0], inverse_z[0], self._faces, nearness)
        with np.errstate(divide="ignore"):
            return self._ray_length / nearness


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
        nearness: result, zeros at the start.
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
                at_b = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
                at_c = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
                at_a = 1 - at_b - at_c
                if at_a >= 0 and at_b >= 0 and at_c >= 0:
                    near = at_a * inverse_z[a] + at_b * inverse_z[b] + at_c * inverse_z[c]
                    nearness[row, column] = max(nearness[row, column], near)
