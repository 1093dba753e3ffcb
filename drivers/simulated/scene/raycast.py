"""Ray casting kernels for a sheet on a cylinder: closed-form, and independent of the tracker's models.

They share a file because Numba's cache of a kernel is invalidated by changes of its own file, not of its callees.
"""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Below this curvature [1/m] an arc of 1 m differs from its chord by less than 1e-13 m.
_FLAT = 1e-6

#: Sub-rays per pixel and axis where the sheet ends within a pixel.
_SUBRAYS = 4

#: Tolerance of the shadow test, so that a surface does not shadow itself [m].
_CLEARANCE = 2e-3


@kernel
def intersect(
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    curvature: float,
    cosine: float,
    sine: float,
    offset: float,
    half_width: float,
    half_height: float,
) -> tuple[float, float, float, float]:
    """First intersection of a ray with the sheet; all in the bend frame of the placement [m].

    The cylinder κ(x² + z²) = 2z is a quadratic A λ² + 2 B λ + C = 0 in the distance λ along the ray. Its roots
    are computed as q/A and C/q, so the one that stays finite as κ → 0 becomes the plane's without a case distinction.
    The normal at (x, z) is (−κx, 1 − κz).

    Returns:
        (λ [m], material coordinates a, b [m], cosine of the angle of incidence); λ is NaN if the ray misses.
    """
    A = curvature * (dx * dx + dz * dz)
    B = curvature * (ox * dx + oz * dz) - dz
    C = curvature * (ox * ox + oz * oz) - 2 * oz
    reach = half_width + half_height + abs(offset)
    best, best_a, best_b, best_cosine = np.inf, np.nan, np.nan, np.nan
    discriminant = B * B - A * C
    if discriminant >= 0:
        root = np.sqrt(discriminant)
        q = -(B + root) if B >= 0 else root - B
        for i in range(2):
            distance = C / q if i == 0 else q / A
            x, z = ox + distance * dx, oz + distance * dz
            if distance > 0 and distance < best and abs(x) <= reach and abs(z) <= reach:
                s = offset + (np.arctan2(curvature * x, 1 - curvature * z) / curvature if abs(curvature) > _FLAT else x)
                t = oy + distance * dy
                a, b = cosine * s - sine * t, sine * s + cosine * t
                if abs(a) <= half_width and abs(b) <= half_height:
                    best, best_a, best_b = distance, a, b
                    best_cosine = abs((1 - curvature * z) * dz - curvature * x * dx)
    return (best if best < np.inf else np.nan), best_a, best_b, best_cosine


@kernel
def cast(
    rays: NDArray[np.float64], T_bs: NDArray[np.float64], sheet: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Casts the ray of every pixel centre at the sheet.

    Args:
        rays: unit directions in the sensor frame, (height, width, 3).
        T_bs: pose (4, 4) that maps the sensor frame to the bend frame.
        sheet: (curvature, cosine and sine of the direction, offset, half width, half height).

    Returns:
        sight: (4, height, width): radial distance [m], material a, b [m], cosine of incidence; NaN for a miss.
            share: (height, width): coverage of the pixel by the sheet, here 0 or 1.
    """
    height, width = rays.shape[:2]
    sight = np.empty((4, height, width), np.float32)
    share = np.empty((height, width), np.float32)
    for row in range(height):
        for column in range(width):
            x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
            distance, a, b, cosine = _follow(x, y, z, T_bs, sheet)
            sight[0, row, column], sight[1, row, column] = distance, a
            sight[2, row, column], sight[3, row, column] = b, cosine
            share[row, column] = 0.0 if np.isnan(distance) else 1.0
    return sight, share


@kernel
def antialias_edges(
    rays: NDArray[np.float64],
    T_bs: NDArray[np.float64],
    sheet: NDArray[np.float64],
    sight: NDArray[np.float32],
    share: NDArray[np.float32],
) -> None:
    """Antialiases the result of `cast` at the rim of the sheet by means over sub-rays, in place.

    Directions between pixels are interpolated from the neighbours', accurate to second order in the pixel size.
    In scalars, because small arrays would take as long as all the rest.
    """
    height, width = rays.shape[:2]
    center = share.copy()
    for row in range(1, height - 1):
        for column in range(1, width - 1):
            filled = np.float32(0)
            for i in range(3):
                filled += (
                    center[row - 1 + i, column - 1] + center[row - 1 + i, column] + center[row - 1 + i, column + 1]
                )
            if not 0 < filled < 9:
                continue
            x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
            right_x = (rays[row, column + 1, 0] - rays[row, column - 1, 0]) / (2 * _SUBRAYS)
            right_y = (rays[row, column + 1, 1] - rays[row, column - 1, 1]) / (2 * _SUBRAYS)
            right_z = (rays[row, column + 1, 2] - rays[row, column - 1, 2]) / (2 * _SUBRAYS)
            down_x = (rays[row + 1, column, 0] - rays[row - 1, column, 0]) / (2 * _SUBRAYS)
            down_y = (rays[row + 1, column, 1] - rays[row - 1, column, 1]) / (2 * _SUBRAYS)
            down_z = (rays[row + 1, column, 2] - rays[row - 1, column, 2]) / (2 * _SUBRAYS)
            distance, a, b, cosine, hits = 0.0, 0.0, 0.0, 0.0, 0
            for i in range(_SUBRAYS * _SUBRAYS):
                u, v = (i % _SUBRAYS) - 0.5 * (_SUBRAYS - 1), (i // _SUBRAYS) - 0.5 * (_SUBRAYS - 1)
                dx, dy = x + u * right_x + v * down_x, y + u * right_y + v * down_y
                dz = z + u * right_z + v * down_z
                norm = 1 / np.sqrt(dx * dx + dy * dy + dz * dz)
                found = _follow(dx * norm, dy * norm, dz * norm, T_bs, sheet)
                if not np.isnan(found[0]):
                    distance, a, b, cosine = distance + found[0], a + found[1], b + found[2], cosine + found[3]
                    hits += 1
            share[row, column] = hits / (_SUBRAYS * _SUBRAYS)
            mean = 1 / hits if hits else np.nan
            sight[0, row, column], sight[1, row, column] = distance * mean, a * mean
            sight[2, row, column], sight[3, row, column] = b * mean, cosine * mean


@kernel
def shadowed(
    points_b: NDArray[np.float64], light_b: NDArray[np.float64], sheet: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Shadow mask: True where the sheet blocks `light_b` (3,) from points (height, width, 3), in the bend frame [m]."""
    height, width = points_b.shape[:2]
    dark = np.empty((height, width), np.bool_)
    curvature, cosine, sine, offset, half_width, half_height = sheet
    ox, oy, oz = light_b
    for row in range(height):
        for column in range(width):
            x, y, z = points_b[row, column]
            length = np.sqrt((x - ox) ** 2 + (y - oy) ** 2 + (z - oz) ** 2)
            dx, dy, dz = (x - ox) / length, (y - oy) / length, (z - oz) / length
            found = intersect(ox, oy, oz, dx, dy, dz, curvature, cosine, sine, offset, half_width, half_height)
            dark[row, column] = found[0] < length - _CLEARANCE
    return dark


@kernel
def lookup(
    texture: NDArray[np.float32], columns: NDArray[np.float32], rows: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Bilinear samples (height, width, channels) of a texture (rows, columns, channels) at texel coordinates.

    Coordinates (height, width) are clamped to the texture; NaN reads zero.
    """
    height, width = columns.shape
    channels = texture.shape[2]
    values = np.zeros((height, width, channels), np.float32)
    last_row, last_column = texture.shape[0] - 1, texture.shape[1] - 1
    for i in range(height):
        for j in range(width):
            if np.isnan(columns[i, j]):
                continue
            u = min(max(columns[i, j], np.float32(0)), np.float32(last_column))
            v = min(max(rows[i, j], np.float32(0)), np.float32(last_row))
            column, row = min(int(u), last_column - 1), min(int(v), last_row - 1)
            right, down = u - column, v - row
            for channel in range(channels):
                upper = (1 - right) * texture[row, column, channel] + right * texture[row, column + 1, channel]
                lower = (1 - right) * texture[row + 1, column, channel] + right * texture[row + 1, column + 1, channel]
                values[i, j, channel] = (1 - down) * upper + down * lower
    return values


@kernel
def _follow(
    x: float, y: float, z: float, T_bs: NDArray[np.float64], sheet: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Intersects the sensor's ray in direction (x, y, z) with the sheet; as `intersect`."""
    return intersect(
        T_bs[0, 3],
        T_bs[1, 3],
        T_bs[2, 3],
        T_bs[0, 0] * x + T_bs[0, 1] * y + T_bs[0, 2] * z,
        T_bs[1, 0] * x + T_bs[1, 1] * y + T_bs[1, 2] * z,
        T_bs[2, 0] * x + T_bs[2, 1] * y + T_bs[2, 2] * z,
        sheet[0],
        sheet[1],
        sheet[2],
        sheet[3],
        sheet[4],
        sheet[5],
    )
