"""Ray casting kernels for a ribbon: a planar polyline, extruded sideways.

All in the profile frame: x and y in the plane of the curve, z across the ribbon. A ribbon is given by nodes (n, 4):
x, y [m], and the unit tangent of the curve; nodes are equidistant along the curve.
"""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Tolerance of the shadow test, so that a ribbon does not shadow itself [m].
_CLEARANCE = 2e-3


@kernel
def intersect_ribbon(
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    nodes: NDArray[np.float64],
    half_width: float,
) -> tuple[float, float, float, float]:
    """First intersection of a ray with the ribbon.

    In the side view the ray is a line in the plane; it crosses the chords whose ends lie on opposite sides of it.

    Returns:
        (distance [m], position along the curve in chords, position across [m], cosine of incidence); NaN for a miss.
    """
    best, place, across, cosine = np.inf, np.nan, np.nan, np.nan
    square = dx * dx + dy * dy
    before = (nodes[0, 0] - ox) * dy - (nodes[0, 1] - oy) * dx
    for i in range(len(nodes) - 1):
        after = (nodes[i + 1, 0] - ox) * dy - (nodes[i + 1, 1] - oy) * dx
        if (before > 0) != (after > 0):
            f = before / (before - after)
            x = nodes[i, 0] + f * (nodes[i + 1, 0] - nodes[i, 0]) - ox
            y = nodes[i, 1] + f * (nodes[i + 1, 1] - nodes[i, 1]) - oy
            distance = (x * dx + y * dy) / square
            side = oz + distance * dz
            if 0 < distance < best and abs(side) <= half_width:
                best, place, across = distance, i + f, side
                along_x = nodes[i, 2] + f * (nodes[i + 1, 2] - nodes[i, 2])
                along_y = nodes[i, 3] + f * (nodes[i + 1, 3] - nodes[i, 3])
                cosine = abs(along_x * dy - along_y * dx)
        before = after
    return (best if best < np.inf else np.nan), place, across, cosine


@kernel
def cast_ribbon(
    rays: NDArray[np.float64], T_ps: NDArray[np.float64], nodes: NDArray[np.float64], half_width: float
) -> NDArray[np.float32]:
    """Casts rays at a ribbon.

    Args:
        rays: unit directions in the sensor frame, (height, width, 3).
        T_ps: pose (4, 4) that maps the sensor frame to the profile frame.
        nodes: of the ribbon, (n, 4).
        half_width: of the ribbon [m].

    Returns:
        (4, height, width), as `intersect_ribbon`.
    """
    height, width = rays.shape[:2]
    sight = np.empty((4, height, width), np.float32)
    ox, oy, oz = T_ps[0, 3], T_ps[1, 3], T_ps[2, 3]
    for row in range(height):
        for column in range(width):
            x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
            dx = T_ps[0, 0] * x + T_ps[0, 1] * y + T_ps[0, 2] * z
            dy = T_ps[1, 0] * x + T_ps[1, 1] * y + T_ps[1, 2] * z
            dz = T_ps[2, 0] * x + T_ps[2, 1] * y + T_ps[2, 2] * z
            found = intersect_ribbon(ox, oy, oz, dx, dy, dz, nodes, half_width)
            sight[0, row, column], sight[1, row, column] = found[0], found[1]
            sight[2, row, column], sight[3, row, column] = found[2], found[3]
    return sight


@kernel
def shadowed_by_ribbon(
    points_p: NDArray[np.float64], light_p: NDArray[np.float64], nodes: NDArray[np.float64], half_width: float
) -> NDArray[np.bool_]:
    """Shadow mask (height, width): True where a ribbon blocks `light_p` (3,) from points (height, width, 3) [m]."""
    height, width = points_p.shape[:2]
    dark = np.empty((height, width), np.bool_)
    ox, oy, oz = light_p[0], light_p[1], light_p[2]
    for row in range(height):
        for column in range(width):
            x, y, z = points_p[row, column, 0] - ox, points_p[row, column, 1] - oy, points_p[row, column, 2] - oz
            length = np.sqrt(x * x + y * y + z * z)
            found = intersect_ribbon(ox, oy, oz, x / length, y / length, z / length, nodes, half_width)
            dark[row, column] = found[0] < length - _CLEARANCE
    return dark
