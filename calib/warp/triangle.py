"""A triangle in an image: the pixels around it, and the barycentric weights of a pixel."""

from typing import NamedTuple

import numpy as np

from calib.jit import kernel


class Triangle(NamedTuple):
    """Corners a, b and c.

    Attributes:
        ax, ay: column and row of a [px].
        bx, by, cx, cy: columns and rows of b and c, from a [px].
        area: twice the signed area [px²], negative if a, b, c are clockwise with y down.
    """

    ax: np.float32
    ay: np.float32
    bx: np.float32
    by: np.float32
    cx: np.float32
    cy: np.float32
    area: np.float32


@kernel
def triangle(
    ax: np.float32, ay: np.float32, bx: np.float32, by: np.float32, cx: np.float32, cy: np.float32
) -> Triangle:
    """The triangle with corners (ax, ay), (bx, by) and (cx, cy) [px]."""
    bx, by, cx, cy = bx - ax, by - ay, cx - ax, cy - ay
    return Triangle(ax, ay, bx, by, cx, cy, bx * cy - by * cx)


@kernel
def columns_of(at: Triangle) -> tuple[np.float32, np.float32]:
    """Leftmost and rightmost column [px]."""
    zero = np.float32(0)
    return at.ax + min(at.bx, at.cx, zero), at.ax + max(at.bx, at.cx, zero)


@kernel
def rows_of(at: Triangle) -> tuple[np.float32, np.float32]:
    """Highest and lowest row [px]."""
    zero = np.float32(0)
    return at.ay + min(at.by, at.cy, zero), at.ay + max(at.by, at.cy, zero)


@kernel
def weights_at(
    at: Triangle, per_area: np.floating, row: np.floating, column: np.floating
) -> tuple[np.floating, np.floating]:
    """Barycentric weights of b and c at a pixel's centre; a has the rest of 1.

    Args:
        at: the triangle.
        per_area: 1 / area, in the precision of the result.
        row, column: of the pixel, in that precision.
    """
    x, y = column - at.ax, row - at.ay
    return (x * at.cy - y * at.cx) * per_area, (at.bx * y - at.by * x) * per_area
