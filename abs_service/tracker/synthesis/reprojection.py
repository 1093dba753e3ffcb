"""A depth image as another camera would have it: its pixels' quadrilaterals, rendered by a z-buffer."""

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.jit import kernel

#: Neighbours whose distances differ by more belong to different surfaces; nothing is rendered between them [m].
LARGEST_STEP_M = 0.04


class Reprojection:
    """Warps distances from one camera into another one without distortion (section 3.2)."""

    def __init__(self, source: Camera, target: Camera):
        self._target = target
        self._source = source
        self._rays = source.rays()
        self._ray_length = (1 / target.rays()[..., 2]).astype(np.float32)

    def warp(self, distance: NDArray[np.float32]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """What the target camera would measure of the surfaces in a depth image.

        Args:
            distance: radial distances (height, width) [m] of the source, NaN without return.

        Returns:
            For every pixel of the target (height, width) the index of the nearest measurement in the source's flattened
            image with a border of one pixel, 0 where there is none, and the radial distance from the target [m], NaN
            where there is none.
        """
        points = pose.transform(self._source.T_rs, self._rays * distance[..., None].astype(np.float64))
        local = pose.transform(self._target.T_sr, points)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse_z = np.where(local[..., 2] > 1e-3, 1 / local[..., 2], np.nan)
        camera = self._target
        place = local[..., :2] * inverse_z[..., None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        place = np.where(np.isfinite(place), place, 0)
        nearness = np.zeros((camera.height, camera.width), np.float32)
        index = np.zeros((camera.height, camera.width), np.int32)
        _render(place.astype(np.float32), inverse_z.astype(np.float32), distance, LARGEST_STEP_M, nearness, index)
        with np.errstate(divide="ignore"):
            return index, np.where(index > 0, self._ray_length / nearness, np.float32(np.nan))


@kernel
def _render(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    distance: NDArray[np.float32],
    largest_step: float,
    nearness: NDArray[np.float32],
    index: NDArray[np.int32],
) -> None:
    """Fills `nearness` (1/z) and `index` with the nearest of all quadrilaterals between four neighbouring pixels."""
    rows, columns = inverse_z.shape
    for r in range(rows - 1):
        for c in range(columns - 1):
            near = min(distance[r, c], distance[r + 1, c], distance[r, c + 1], distance[r + 1, c + 1])
            far = max(distance[r, c], distance[r + 1, c], distance[r, c + 1], distance[r + 1, c + 1])
            total = inverse_z[r, c] + inverse_z[r + 1, c] + inverse_z[r, c + 1] + inverse_z[r + 1, c + 1]
            if np.isnan(total) or far - near > largest_step:
                continue
            _triangle(place, inverse_z, r, c, 1, nearness, index)
            _triangle(place, inverse_z, r, c, 0, nearness, index)


@kernel
def _triangle(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    r: int,
    c: int,
    lower: int,
    nearness: NDArray[np.float32],
    index: NDArray[np.int32],
) -> None:
    """One half of the quadrilateral below and right of pixel (r, c): below its diagonal if `lower` is 1, else above."""
    height, width = nearness.shape
    stride = place.shape[1] + 2
    middle_r, middle_c = r + lower, c + 1 - lower
    ax, ay = place[r, c, 0], place[r, c, 1]
    bx, by = place[middle_r, middle_c, 0], place[middle_r, middle_c, 1]
    cx, cy = place[r + 1, c + 1, 0], place[r + 1, c + 1, 1]
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area == 0:
        return
    edge = np.float32(-1e-4)  # a pixel that lies on the line between two halves must not fall between them
    for row in range(
        max(int(np.ceil(min(ay, by, cy) - 1e-3)), 0), min(int(np.floor(max(ay, by, cy) + 1e-3)), height - 1) + 1
    ):
        for column in range(
            max(int(np.ceil(min(ax, bx, cx) - 1e-3)), 0), min(int(np.floor(max(ax, bx, cx) + 1e-3)), width - 1) + 1
        ):
            at_b = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
            at_c = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
            at_a = 1 - at_b - at_c
            near = at_a * inverse_z[r, c] + at_b * inverse_z[middle_r, middle_c] + at_c * inverse_z[r + 1, c + 1]
            if at_a >= edge and at_b >= edge and at_c >= edge and near > nearness[row, column]:
                nearness[row, column] = near
                source_r, source_c = (r, c) if at_a >= at_b and at_a >= at_c else (r + 1, c + 1)
                if at_b > at_a and at_b > at_c:
                    source_r, source_c = middle_r, middle_c
                index[row, column] = (source_r + 1) * stride + source_c + 1
