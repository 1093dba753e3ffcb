"""Attributes of a view's pixels, interpolated from the source faces that cover them."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel
from calib.warp.raster import corners


@kernel
def weigh(
    face: NDArray[np.int32],
    nearness: NDArray[np.float32],
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    row: int,
    column: int,
) -> tuple[int, int, int, np.float32, np.float32, np.float32]:
    """Three source pixels (flat indices) around a pixel of the view, with perspective-correct weights."""
    columns = place.shape[1]
    quadrilateral, missing = face[row, column] // 4, face[row, column] % 4
    r, c = quadrilateral // columns, quadrilateral % columns
    i, j, k = corners(missing)
    ar, ac, br, bc, cr, cc = r + i // 2, c + i % 2, r + j // 2, c + j % 2, r + k // 2, c + k % 2
    ax, ay = place[ar, ac, 0], place[ar, ac, 1]
    bx, by = place[br, bc, 0] - ax, place[br, bc, 1] - ay
    cx, cy = place[cr, cc, 0] - ax, place[cr, cc, 1] - ay
    x, y = np.float32(column) - ax, np.float32(row) - ay
    area, z = bx * cy - by * cx, np.float32(1) / nearness[row, column]
    at_b, at_c = (x * cy - y * cx) / area, (bx * y - by * x) / area
    at_a = np.float32(1) - at_b - at_c
    first, second, third = ar * columns + ac, br * columns + bc, cr * columns + cc
    return (
        first,
        second,
        third,
        at_a * inverse_z[ar, ac] * z,
        at_b * inverse_z[br, bc] * z,
        at_c * inverse_z[cr, cc] * z,
    )


@kernel
def measure(
    face: NDArray[np.int32],
    nearness: NDArray[np.float32],
    ray_length: NDArray[np.float32],
    top: int,
    bottom: int,
    distance: NDArray[np.float32],
) -> None:
    """Radial distances of rows `top` to `bottom` − 1, NaN without a face."""
    for row in range(top, bottom):
        for column in range(face.shape[1]):
            far = ray_length[row, column] / nearness[row, column]
            distance[row, column] = far if face[row, column] >= 0 else np.float32(np.nan)


@kernel
def nearest(
    face: NDArray[np.int32],
    nearness: NDArray[np.float32],
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    index: NDArray[np.int32],
) -> None:
    """Source pixel (flat index) with the largest weight in every pixel of the view; −1 without a face."""
    for row in range(face.shape[0]):
        for column in range(face.shape[1]):
            index[row, column] = -1
            if face[row, column] >= 0:
                a, b, c, at_a, at_b, at_c = weigh(face, nearness, place, inverse_z, row, column)
                index[row, column] = a if at_a >= at_b and at_a >= at_c else (b if at_b >= at_c else c)


@kernel
def blend(
    face: NDArray[np.int32],
    nearness: NDArray[np.float32],
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    values: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """Values (n,) of the source's pixels, linearly interpolated within every face; NaN without a face."""
    for row in range(face.shape[0]):
        for column in range(face.shape[1]):
            result[row, column] = np.nan
            if face[row, column] >= 0:
                a, b, c, at_a, at_b, at_c = weigh(face, nearness, place, inverse_z, row, column)
                result[row, column] = at_a * values[a] + at_b * values[b] + at_c * values[c]


@kernel
def deviate(
    face: NDArray[np.int32],
    nearness: NDArray[np.float32],
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    distance: NDArray[np.float32],
    rays: NDArray[np.float32],
    shift: NDArray[np.float32],
    view_rays: NDArray[np.float32],
    sigma: NDArray[np.float32],
    bend: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """Deviation of the warped distances: ∂D/∂d_i = b_i (n · r_i) / (n · q), with normal n and viewing directions r, q.

    Distances (n,), rays (n, 3), `sigma` and `bend`, the interpolation error, (n,) are the source's.
    """
    p = np.empty((3, 3), np.float32)
    normal = np.empty(3, np.float32)
    for row in range(face.shape[0]):
        for column in range(face.shape[1]):
            result[row, column] = np.nan
            if face[row, column] < 0:
                continue
            a, b, c, at_a, at_b, at_c = weigh(face, nearness, place, inverse_z, row, column)
            for axis in range(3):
                p[0, axis] = distance[a] * rays[a, axis] + shift[axis]
                p[1, axis] = distance[b] * rays[b, axis] + shift[axis] - p[0, axis]
                p[2, axis] = distance[c] * rays[c, axis] + shift[axis] - p[0, axis]
            normal[0] = p[1, 1] * p[2, 2] - p[1, 2] * p[2, 1]
            normal[1] = p[1, 2] * p[2, 0] - p[1, 0] * p[2, 2]
            normal[2] = p[1, 0] * p[2, 1] - p[1, 1] * p[2, 0]
            along, gain_a, gain_b, gain_c = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            for axis in range(3):
                along += normal[axis] * view_rays[row, column, axis]
                gain_a += normal[axis] * rays[a, axis]
                gain_b += normal[axis] * rays[b, axis]
                gain_c += normal[axis] * rays[c, axis]
            gain_a, gain_b, gain_c = at_a * gain_a / along, at_b * gain_b / along, at_c * gain_c / along
            noise = (gain_a * sigma[a]) ** 2 + (gain_b * sigma[b]) ** 2 + (gain_c * sigma[c]) ** 2
            off = gain_a * bend[a] + gain_b * bend[b] + gain_c * bend[c]
            result[row, column] = np.sqrt(noise + off * off)
