"""Rasterisation of a depth image: triangles between neighbouring pixels, with a z-buffer.

Four neighbours span two triangles, three span one. Corner k of the quadrilateral at pixel (r, c) is pixel (r + k // 2,
c + k % 2); a triangle is identified by its missing corner m, and its face index is 4 (r columns + c) + m.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel
from calib.warp.points import Source
from calib.warp.triangle import Triangle, columns_of, rows_of, triangle, weights_at

#: Tolerance that closes the seam between two triangles.
_EDGE = -1e-4


class ZBuffer(NamedTuple):
    """The nearest face at each pixel of a view (height, width).

    Attributes:
        nearness: its 1/z there [1/m], 0 without one.
        face: its index, −1 without one.
    """

    nearness: NDArray[np.float32]
    face: NDArray[np.int32]


@kernel
def cover(
    source: Source,
    maximum_step: float,
    rows: tuple[int, int],
    buffer: ZBuffer,
) -> None:
    """Rasterises rows `rows[0]` to `rows[1]` − 1 of the buffer with the nearest faces.

    Both triangles of a quadrilateral, beside the diagonal from corner 0 to corner 3, are filled in one pass.
    """
    place, inverse_z, distance = source
    (nearness, face), (top, bottom) = buffer, rows
    zero, one, edge = np.float32(0), np.float32(1), np.float32(_EDGE)
    slack, step = np.float32(1e-3), np.float32(maximum_step)
    columns, width, lowest, highest = place.shape[1], nearness.shape[1], np.float32(top), np.float32(bottom - 1)
    rightmost = np.float32(width - 1)
    for r in range(place.shape[0] - 1):
        for c in range(columns - 1):
            x0, y0, n0, d0 = place[r, c, 0], place[r, c, 1], inverse_z[r, c], distance[r, c]
            n1, n2, n3 = inverse_z[r, c + 1] - n0, inverse_z[r + 1, c] - n0, inverse_z[r + 1, c + 1] - n0
            d1, d2, d3 = distance[r, c + 1], distance[r + 1, c], distance[r + 1, c + 1]
            if not max(d0, d1, d2, d3) - min(d0, d1, d2, d3) <= step or np.isnan(n1 + n2 + n3):
                _fill_rest(source, step, r, c, rows, buffer)
                continue
            x1, y1 = place[r, c + 1, 0] - x0, place[r, c + 1, 1] - y0
            x2, y2 = place[r + 1, c, 0] - x0, place[r + 1, c, 1] - y0
            x3, y3 = place[r + 1, c + 1, 0] - x0, place[r + 1, c + 1, 1] - y0
            low, high = y0 + min(y1, y2, y3, zero) - slack, y0 + max(y1, y2, y3, zero) + slack
            left, right = x0 + min(x1, x2, x3, zero) - slack, x0 + max(x1, x2, x3, zero) + slack
            first_row, last_row = int(np.ceil(max(low, lowest))), int(np.floor(min(high, highest)))
            first_column, last_column = int(np.ceil(max(left, zero))), int(np.floor(min(right, rightmost)))
            if first_row > last_row or first_column > last_column:
                continue
            first, second = x1 * y3 - y1 * x3, x2 * y3 - y2 * x3
            if not first * second < zero:  # folded or degenerate
                _fill(source, r, c, 1, rows, buffer)
                _fill(source, r, c, 2, rows, buffer)
                continue
            per_first, per_second = one / first, one / second
            for row in range(first_row, last_row + 1):
                y = np.float32(row) - y0
                for column in range(first_column, last_column + 1):
                    x = np.float32(column) - x0
                    side = x * y3 - y * x3
                    above = side * per_first >= zero
                    xb, yb, nb, per_area = (x1, y1, n1, per_first) if above else (x2, y2, n2, per_second)
                    at_b, at_d = side * per_area, (xb * y - yb * x) * per_area
                    near = n0 + at_b * nb + at_d * n3
                    if at_d >= edge and one - at_b - at_d >= edge and near > nearness[row, column]:
                        nearness[row, column] = near
                        face[row, column] = 4 * (r * columns + c) + (2 if above else 1)


@kernel
def _fill_rest(
    source: Source,
    step: np.float32,
    r: int,
    c: int,
    rows: tuple[int, int],
    buffer: ZBuffer,
) -> None:
    """Single triangle of a quadrilateral with one missing corner, unless it spans a depth edge."""
    inverse_z = source.inverse_z
    missing = lone_gap(inverse_z[r, c], inverse_z[r, c + 1], inverse_z[r + 1, c], inverse_z[r + 1, c + 1])
    if missing >= 0 and height_of_step(source.distance, r, c) <= step:
        _fill(source, r, c, missing, rows, buffer)


@kernel
def lone_gap(n0: np.float32, n1: np.float32, n2: np.float32, n3: np.float32) -> int:
    """Index of the only NaN among four values; −1 if there is none or more than one."""
    if np.isnan(n0):
        return -1 if np.isnan(n1 + n2 + n3) else 0
    if np.isnan(n1):
        return -1 if np.isnan(n2 + n3) else 1
    if np.isnan(n2):
        return -1 if np.isnan(n3) else 2
    return 3


@kernel
def height_of_step(distance: NDArray[np.float32], r: int, c: int) -> np.float32:
    """Largest difference of the known distances of a quadrilateral's corners [m]."""
    near, far = np.float32(np.inf), np.float32(-np.inf)
    for k in range(4):
        d = distance[r + k // 2, c + k % 2]
        near, far = d if d < near else near, d if d > far else far
    return far - near


@kernel
def _fill(
    source: Source,
    r: int,
    c: int,
    missing: int,
    rows: tuple[int, int],
    buffer: ZBuffer,
) -> None:
    """Rasterises one triangle into the z-buffer."""
    place, inverse_z, (nearness, face), (top, bottom) = source.place, source.inverse_z, buffer, rows
    i, j, k = corners(missing)
    ar, ac, br, bc, cr, cc = r + i // 2, c + i % 2, r + j // 2, c + j % 2, r + k // 2, c + k % 2
    at, slack = _triangle(place, r, c, missing), np.float32(1e-3)
    (highest, lowest), (leftmost, rightmost) = rows_of(at), columns_of(at)
    first_row, last_row = max(int(np.ceil(highest - slack)), top), min(int(np.floor(lowest + slack)), bottom - 1)
    first_column = max(int(np.ceil(leftmost - slack)), 0)
    last_column = min(int(np.floor(rightmost + slack)), nearness.shape[1] - 1)
    if first_row > last_row or first_column > last_column or at.area == 0:
        return
    edge, one = np.float32(_EDGE), np.float32(1)
    per_area, near_a = one / at.area, inverse_z[ar, ac]
    near_b, near_c = inverse_z[br, bc] - near_a, inverse_z[cr, cc] - near_a
    number = 4 * (r * place.shape[1] + c) + missing
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            at_b, at_c = weights_at(at, per_area, np.float32(row), np.float32(column))
            if at_b >= edge and at_c >= edge and one - at_b - at_c >= edge:
                near = near_a + at_b * near_b + at_c * near_c
                if near > nearness[row, column]:
                    nearness[row, column] = near
                    face[row, column] = number


@kernel
def fray(
    source: Source,
    maximum_step: float,
    reach: NDArray[np.float32],
    buffer: ZBuffer,
    warped: NDArray[np.float32],
) -> None:
    """Invalidates the background within one source pixel of a depth edge.

    The foreground ends anywhere between its last pixel centre and the next, so either surface may be visible there.
    `reach` (h, w) is that width in the view for a distance of 1 and a 1/z of 1 [px].
    """
    place, inverse_z, distance = source
    nearness, face = buffer
    height, width = face.shape
    step, one = np.float32(maximum_step), np.float32(1)
    for r in range(place.shape[0] - 1):
        for c in range(place.shape[1] - 1):
            d0, d1, d2, d3 = distance[r, c], distance[r, c + 1], distance[r + 1, c], distance[r + 1, c + 1]
            if max(d0, d1, d2, d3) - min(d0, d1, d2, d3) <= step or not height_of_step(distance, r, c) > step:
                continue
            for k in range(4):
                y, x = r + k // 2, c + k % 2
                z = one / inverse_z[y, x]
                if np.isnan(z) or not largest(distance, r, c) - distance[y, x] > step:
                    continue
                near, row, column = reach[y, x] * distance[y, x] / z, place[y, x, 1], place[y, x, 0]
                for i in range(max(int(np.ceil(row - near)), 0), min(int(np.floor(row + near)), height - 1) + 1):
                    left, right = max(int(np.ceil(column - near)), 0), min(int(np.floor(column + near)), width - 1)
                    for j in range(left, right + 1):
                        if face[i, j] >= 0 and one / nearness[i, j] > z + step:
                            face[i, j] = -1
                            warped[i, j] = np.nan


@kernel
def largest(distance: NDArray[np.float32], r: int, c: int) -> np.float32:
    """Largest known distance of a quadrilateral's corners [m]."""
    far = np.float32(-np.inf)
    for k in range(4):
        d = distance[r + k // 2, c + k % 2]
        far = d if d > far else far
    return far


@kernel
def tear(
    source: Source,
    maximum_step: float,
    torn: NDArray[np.bool_],
) -> None:
    """Marks pixels behind depth edges: the region between foreground and background is unobserved."""
    place, inverse_z, distance = source
    for r in range(place.shape[0] - 1):
        for c in range(place.shape[1] - 1):
            if not height_of_step(distance, r, c) > maximum_step:
                continue
            n0, n1, n2, n3 = inverse_z[r, c], inverse_z[r, c + 1], inverse_z[r + 1, c], inverse_z[r + 1, c + 1]
            gap = lone_gap(n0, n1, n2, n3)
            for missing in range(4):
                if missing == gap or (not np.isnan(n0 + n1 + n2 + n3) and 1 <= missing <= 2):
                    _fill_torn(_triangle(place, r, c, missing), torn)


@kernel
def _fill_torn(at: Triangle, torn: NDArray[np.bool_]) -> None:
    """Marks the pixels of a triangle."""
    (height, width), one = torn.shape, np.float32(1)
    if at.area == 0:
        return
    per_area = one / at.area
    (highest, lowest), (leftmost, rightmost) = rows_of(at), columns_of(at)
    left, right = max(int(np.ceil(leftmost)), 0), min(int(np.floor(rightmost)), width - 1)
    for row in range(max(int(np.ceil(highest)), 0), min(int(np.floor(lowest)), height - 1) + 1):
        for column in range(left, right + 1):
            at_b, at_c = weights_at(at, per_area, np.float32(row), np.float32(column))
            if at_b >= 0 and at_c >= 0 and at_b + at_c <= one:
                torn[row, column] = True


@kernel
def _triangle(place: NDArray[np.float32], r: int, c: int, missing: int) -> Triangle:
    """The triangle of a quadrilateral that lacks one corner."""
    i, j, k = corners(missing)
    a, b, d = place[r + i // 2, c + i % 2], place[r + j // 2, c + j % 2], place[r + k // 2, c + k % 2]
    return triangle(a[0], a[1], b[0], b[1], d[0], d[1])


@kernel
def corners(missing: int) -> tuple[int, int, int]:
    """The three corners of the triangle that lacks one."""
    return 1 if missing == 0 else 0, 2 if missing < 2 else 1, 2 if missing == 3 else 3
