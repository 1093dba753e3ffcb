"""Kernels of the renderer: points to sub-pixels, refinement per sub-pixel, and averaging to pixels."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: What is kept of a sub-pixel: distance, light, red, green, blue, and whether a sheet covers it.
CHANNELS = 6

#: What is seen nowhere is so far away [m].
MAX_DISTANCE_M = 1e6

#: A line of sight that meets a point's tangent plane farther from it than so many sub-pixels passes the surface by.
#: A surface that is inclined by more than 83° is so stretched in the image that it is lost.
_REACH_PX = 6.0


@kernel
def transform(T_sr: NDArray[np.float64], points_r: NDArray[np.float64], points_s: NDArray[np.float64]) -> None:
    """Writes points (rows, columns, 3) of the rig in sensor coordinates."""
    for r in range(points_r.shape[0]):
        for c in range(points_r.shape[1]):
            x, y, z = points_r[r, c, 0], points_r[r, c, 1], points_r[r, c, 2]
            for i in range(3):
                points_s[r, c, i] = T_sr[i, 0] * x + T_sr[i, 1] * y + T_sr[i, 2] * z + T_sr[i, 3]


@kernel
def splat(points: NDArray[np.float64], matrix: NDArray[np.float64], winner: NDArray[np.int64]) -> None:
    """Projects a grid of points (rows, columns, 3) in sensor coordinates; the nearest of each sub-pixel wins.

    Args:
        points: [m].
        matrix: fx, fy, cx, cy of the sub-pixels.
        winner: index of the nearest point (height, width), −1 before and where none falls.
    """
    height, width = winner.shape
    nearest = np.full((height, width), MAX_DISTANCE_M)
    fx, fy, cx, cy = matrix
    for r in range(points.shape[0]):
        for c in range(points.shape[1]):
            x, y, z = points[r, c, 0], points[r, c, 1], points[r, c, 2]
            if z <= 0:
                continue
            u, v = np.floor(fx * x / z + cx + 0.5), np.floor(fy * y / z + cy + 0.5)
            if not (0 <= u < width and 0 <= v < height):
                continue
            i, j = int(v), int(u)
            square = x * x + y * y + z * z
            if square < nearest[i, j]:
                nearest[i, j] = square
                winner[i, j] = r * points.shape[1] + c


@kernel
def look(
    points: NDArray[np.float64],
    winner: NDArray[np.int64],
    rays: NDArray[np.float64],
    focal: float,
    reflectivity: NDArray[np.float64],
    color: NDArray[np.float64],
    seen: NDArray[np.float64],
) -> None:
    """Meets every sub-pixel's line of sight with the surface around the point that won it; the nearest is seen.

    Args:
        points: (rows, columns, 3) [m] in sensor coordinates.
        winner: see `splat`.
        rays: unit directions (height, width, 3).
        focal: focal length in sub-pixels.
        reflectivity, color: of the sheet, (h, w) and (h, w, 3).
        seen: sub-pixels (height, width, channels), changed where the sheet is nearer.
    """
    rows, columns = points.shape[0], points.shape[1]
    for i in range(winner.shape[0]):
        for j in range(winner.shape[1]):
            if winner[i, j] < 0:
                continue
            r, c = winner[i, j] // columns, winner[i, j] % columns
            distance, at_row, at_column, cosine = _meet(points, r, c, rays[i, j], _REACH_PX / focal)
            if not (0 < distance < seen[i, j, 0] and 0 <= at_row <= rows - 1 and 0 <= at_column <= columns - 1):
                continue
            u, w = at_row / (rows - 1), at_column / (columns - 1)
            k, m, f, g = _cell(reflectivity.shape[0], reflectivity.shape[1], u, w)
            bright = (1 - f) * ((1 - g) * reflectivity[k, m] + g * reflectivity[k, m + 1])
            bright += f * ((1 - g) * reflectivity[k + 1, m] + g * reflectivity[k + 1, m + 1])
            seen[i, j, 0], seen[i, j, 1], seen[i, j, 5] = distance, bright * cosine / distance**2, 1
            k, m, f, g = _cell(color.shape[0], color.shape[1], u, w)
            for channel in range(3):
                above = (1 - g) * color[k, m, channel] + g * color[k, m + 1, channel]
                below = (1 - g) * color[k + 1, m, channel] + g * color[k + 1, m + 1, channel]
                seen[i, j, 2 + channel] = (1 - f) * above + f * below


@kernel
def mix(seen: NDArray[np.float64], n: int, mixed: NDArray[np.float64]) -> None:
    """Means (height, width, channels) of n × n sub-pixels; of the distance, the mean of distance · light."""
    for i in range(mixed.shape[0]):
        for j in range(mixed.shape[1]):
            mixed[i, j] = 0
            for a in range(n):
                for b in range(n):
                    one = seen[n * i + a, n * j + b]
                    mixed[i, j, 0] += one[0] * one[1]
                    for channel in range(1, CHANNELS):
                        mixed[i, j, channel] += one[channel]
            mixed[i, j] /= n**2


@kernel
def _meet(
    points: NDArray[np.float64], r: int, c: int, ray: NDArray[np.float64], reach: float
) -> tuple[float, float, float, float]:
    """Intersection of a ray with the tangent plane of a point: distance [m], row, column, cosine of incidence.

    The distance is −1 if it does not, or too far from the point for the plane to be the surface.
    """
    up, down = max(r - 1, 0), min(r + 1, points.shape[0] - 1)
    left, right = max(c - 1, 0), min(c + 1, points.shape[1] - 1)
    s, t = 1 / (down - up), 1 / (right - left)
    ax, bx = s * (points[down, c, 0] - points[up, c, 0]), t * (points[r, right, 0] - points[r, left, 0])
    ay, by = s * (points[down, c, 1] - points[up, c, 1]), t * (points[r, right, 1] - points[r, left, 1])
    az, bz = s * (points[down, c, 2] - points[up, c, 2]), t * (points[r, right, 2] - points[r, left, 2])
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    px, py, pz = points[r, c, 0], points[r, c, 1], points[r, c, 2]
    square = nx * nx + ny * ny + nz * nz
    facing = nx * ray[0] + ny * ray[1] + nz * ray[2]
    if square <= 0 or abs(facing) < 1e-3 * np.sqrt(square):
        return -1.0, 0.0, 0.0, 0.0
    distance = (nx * px + ny * py + nz * pz) / facing
    gx, gy, gz = distance * ray[0] - px, distance * ray[1] - py, distance * ray[2] - pz
    aa, ab, bb = ax * ax + ay * ay + az * az, ax * bx + ay * by + az * bz, bx * bx + by * by + bz * bz
    ga, gb = gx * ax + gy * ay + gz * az, gx * bx + gy * by + gz * bz
    f, g = (ga * bb - gb * ab) / square, (gb * aa - ga * ab) / square
    if gx * gx + gy * gy + gz * gz > (reach * distance) ** 2:
        return -1.0, 0.0, 0.0, 0.0
    return distance, r + f, c + g, abs(facing) / np.sqrt(square)


@kernel
def _cell(height: int, width: int, u: float, w: float) -> tuple[int, int, float, float]:
    """Upper left corner and the share of the way to the lower right one of a place in the unit square."""
    i, j = min(int(u * (height - 1)), height - 2), min(int(w * (width - 1)), width - 2)
    return i, j, u * (height - 1) - i, w * (width - 1) - j
