"""Surface splatting of a depth image into another view, for thin objects and sparse images.

M. Zwicker, H. Pfister, J. van Baar, M. Gross: Surface splatting. SIGGRAPH 2001; with tent kernels instead of Gaussians.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.jit import kernel
from calib.warp import errors
from calib.warp.mesh import MAX_STEP_M
from calib.warp.points import Geometry, Points

#: Width of a splat relative to its source pixel, so that rotated and slanted surfaces have no gaps.
WIDTH = 1.5


class SplatWarp:
    """Warps a depth image into any other view, each measurement separately.

    The nearest surface wins; a pixel gets the weighted mean of its measurements. Compared with `MeshWarp`, edges are
    dilated and isolated measurements are kept, but slopes are averaged instead of interpolated.
    """

    def __init__(self, source: Camera, target: Camera, maximum_step_m: float = MAX_STEP_M):
        self.geometry = Geometry(source, target)
        self._maximum_step_m = maximum_step_m
        self._ray_length = target.lookup.ray_length.astype(np.float32)
        # Half a splat's size in the view for a distance of 1 and a 1/z of 1.
        lengths = source.lookup.ray_length
        halves = [0.5 * WIDTH * to / of / lengths for to, of in ((target.fx, source.fx), (target.fy, source.fy))]
        self._size = np.stack(halves, axis=-1).astype(np.float32)

    def warp(self, distance: NDArray[np.floating]) -> "Splats":
        """Radial distances (h, w) [m] of the source, NaN without return, in the view.

        Raises:
            WarpError: nothing in the view, or wrong units; names the cause.
        """
        errors.check(distance, self.geometry.source, self.geometry.target)
        points = self.geometry.see(distance)
        half = (self._size * (points.distance * points.inverse_z)[..., None]).astype(np.float32)
        front, shape = np.zeros(self._ray_length.shape, np.float32), self._ray_length.shape
        _advance(points.place, points.inverse_z, half, front)
        splats = Splats(np.full(shape, np.nan, np.float32), points, half, front, self._maximum_step_m)
        sums = splats.sums(np.zeros_like(points.distance))
        known = sums[..., 0] > 0
        if not known.any():
            raise errors.nothing_seen(points, self.geometry.target, np.inf)
        splats.distance[known] = self._ray_length[known] * sums[known, 0] / sums[known, 1]
        return splats


@dataclass(frozen=True, slots=True, eq=False)
class Splats:
    """Depth image in another view.

    Attributes:
        distance: radial distances from the view's centre (height, width) [m], NaN where unknown.
        points: the source's points in the view.
        half: half the size of every splat (h, w, 2) [px].
        front: 1/z of the nearest surface (height, width) [1/m], 0 without one.
        maximum_step_m: measurements farther behind the nearest one belong to another surface [m].
    """

    distance: NDArray[np.float32]
    points: Points
    half: NDArray[np.float32]
    front: NDArray[np.float32]
    maximum_step_m: float

    def deviation(self, sigma: NDArray[np.floating]) -> NDArray[np.float32]:
        """Deviation of the warped distances (height, width) [m], for deviations of the source's (h, w) [m].

        Combines the noise of the weighted mean with the spread of its measurements due to the slope within half a
        pixel.
        """
        sums = self.sums(np.broadcast_to(sigma, self.points.distance.shape))
        with np.errstate(invalid="ignore", divide="ignore"):
            weight, near = sums[..., 0], sums[..., 1] / sums[..., 0]
            apart = np.maximum(sums[..., 2] / weight - near**2, 0) / near**4
            return np.sqrt(sums[..., 3] / weight**2 + apart)

    def sums(self, sigma: NDArray[np.floating]) -> NDArray[np.float32]:
        """Sums per pixel (height, width, 4) of the weights w, of w/z, of w/z² and of w² σ²."""
        result = np.zeros((*self.front.shape, 4), np.float32)
        given = np.ascontiguousarray(sigma, np.float32)
        _gather(self.points.place, self.points.inverse_z, self.half, given, self.maximum_step_m, self.front, result)
        return result


@kernel
def _advance(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    half: NDArray[np.float32],
    front: NDArray[np.float32],
) -> None:
    """Nearest 1/z of all splats that cover a pixel's centre."""
    height, width = front.shape
    for r in range(place.shape[0]):
        for c in range(place.shape[1]):
            near = inverse_z[r, c]
            if np.isnan(near):
                continue
            x, y, right, down = place[r, c, 0], place[r, c, 1], half[r, c, 0], half[r, c, 1]
            for row in range(max(int(np.ceil(y - down)), 0), min(int(np.floor(y + down)), height - 1) + 1):
                for column in range(max(int(np.ceil(x - right)), 0), min(int(np.floor(x + right)), width - 1) + 1):
                    front[row, column] = max(front[row, column], near)


@kernel
def _gather(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    half: NDArray[np.float32],
    sigma: NDArray[np.float32],
    maximum_step: float,
    front: NDArray[np.float32],
    sums: NDArray[np.float32],
) -> None:
    """Accumulates the splats of the nearest surface with tent weights."""
    height, width = front.shape
    one, step = np.float32(1), np.float32(maximum_step)
    for r in range(place.shape[0]):
        for c in range(place.shape[1]):
            near = inverse_z[r, c]
            if np.isnan(near):
                continue
            x, y, right, down = place[r, c, 0], place[r, c, 1], half[r, c, 0], half[r, c, 1]
            noise = sigma[r, c] * sigma[r, c]
            for row in range(max(int(np.ceil(y - down)), 0), min(int(np.floor(y + down)), height - 1) + 1):
                for column in range(max(int(np.ceil(x - right)), 0), min(int(np.floor(x + right)), width - 1) + 1):
                    if one / near - one / front[row, column] <= step:
                        tent = (one - abs(row - y) / down) * (one - abs(column - x) / right)
                        weight = np.float32(max(tent, 1e-6))
                        sums[row, column, 0] += weight
                        sums[row, column, 1] += weight * near
                        sums[row, column, 2] += weight * near * near
                        sums[row, column, 3] += weight * weight * noise
