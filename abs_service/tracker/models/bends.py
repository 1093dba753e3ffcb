"""Lookup tables of FlexPad's bends: a sheet rolled up on one side of a line through its centre, in four directions."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Angles [rad] of the directions a along which the sheet bends, from its x axis towards its y axis.
ANGLES = np.deg2rad([0.0, 45.0, 90.0, 135.0])

#: In-plane unit vectors (8, 2) that point away from the centre: both sides of every direction, the side of a first.
SIDES = (
    np.stack([[np.cos(ANGLES), np.sin(ANGLES)], [-np.cos(ANGLES), -np.sin(ANGLES)]]).transpose(2, 0, 1).reshape(8, 2)
)

#: Largest parameter of a bend: full bend towards (+) or away from (−) the sensor.
FULL = 2.0

#: Largest distance [m] between a vertex and where it would be without tables.
TABLE_ERROR_M = 1e-4


def curvatures(reach: float, least_radius: float) -> NDArray[np.float64]:
    """Curvatures (rows,) [1/m] of the tables, equidistant, zero in the middle.

    Both coordinates of a point on an arc have second derivatives by the curvature of at most Q³/3, so interpolation
    between rows that are Δκ apart errs by at most Δκ² Q³/24 in each; a point lies on four of the eight sides at most.

    Args:
        reach: largest distance Q of a vertex from the centre [m].
        least_radius: radius at a parameter of `FULL` [m].
    """
    spacing = np.sqrt(24 * TABLE_ERROR_M / (4 * np.sqrt(2) * reach**3))
    half = max(int(np.ceil(1 / least_radius / spacing)), 1)
    return np.linspace(-1 / least_radius, 1 / least_radius, 2 * half + 1)


def tabulate(points: NDArray[np.float64], kappa: NDArray[np.float64]) -> NDArray[np.float32]:
    """What every bend does to every vertex.

    With Q the distance from the centre along the bent side, zero on the other side, a vertex moves to sin(κQ)/κ along
    it and rises by (1 − cos κQ)/κ.

    Args:
        points: places (n, 2) of the vertices on the flat sheet, from its centre [m].
        kappa: curvatures (rows,) [1/m].

    Returns:
        (8 sides, rows, 4, n): shift along the side [m], rise [m], and the derivatives of both by Q.
    """
    q = np.maximum(SIDES @ points.T, 0.0)[:, None]
    angle = kappa[:, None] * q
    # sin(κQ)/κ = Q sinc and (1 − cos κQ)/κ = κ Q²/2 sinc², exact as κ → 0: numpy.sinc(x) is sin(πx)/πx.
    shift = q * (np.sinc(angle / np.pi) - 1)
    rise = 0.5 * angle * q * np.sinc(angle / (2 * np.pi)) ** 2
    return np.stack([shift, rise, np.cos(angle) - 1, np.sin(angle)], axis=2).astype(np.float32)


@kernel
def look_up(
    thetas: NDArray[np.float64],
    pose: NDArray[np.float64],
    full_height: float,
    half: float,
    rows: int,
    row: NDArray[np.int32],
    fraction: NDArray[np.float32],
    height: NDArray[np.float32],
    motion: NDArray[np.float32],
) -> None:
    """From FlexPad's parameters to places in the tables, and what comes after them.

    Args:
        thetas: parameters (population, 15).
        pose: of the sheet in the rig (3, 4).
        full_height: largest parameter of the height map.
        half: half the sheet's long side [m].
        rows: of the tables.
        row, fraction: place of every bend between two rows of its table (population, 8).
        height: g/c of the height map (population,) [1/m].
        motion: rotation and translation from sheet to rig (population, 3, 4).
    """
    turn = np.empty((3, 3))
    for k in range(thetas.shape[0]):
        theta = thetas[k]
        for j in range(8):
            bounded = min(max(theta[j], -FULL), FULL)
            place = (bounded / FULL + 1) * ((rows - 1) / 2)
            row[k, j] = min(int(place), rows - 2)
            fraction[k, j] = place - row[k, j]
        height[k] = min(max(theta[8], -full_height), full_height) / half
        _turn(theta[9], theta[10], theta[11], turn)
        for i in range(3):
            for j in range(3):
                motion[k, i, j] = turn[i, 0] * pose[0, j] + turn[i, 1] * pose[1, j] + turn[i, 2] * pose[2, j]
            motion[k, i, 3] = pose[i, 3] + theta[12 + i]


@kernel
def _turn(x: float, y: float, z: float, turn: NDArray[np.float64]) -> None:
    """The rotation (3, 3) of a rotation vector, by Rodrigues' formula; its series near zero."""
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    a = np.sin(angle) / angle if square > 1e-8 else 1 - square / 6
    b = (1 - np.cos(angle)) / square if square > 1e-8 else 0.5 - square / 24
    turn[0, 0], turn[0, 1], turn[0, 2] = 1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    turn[1, 0], turn[1, 1], turn[1, 2] = b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x
    turn[2, 0], turn[2, 1], turn[2, 2] = b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)
