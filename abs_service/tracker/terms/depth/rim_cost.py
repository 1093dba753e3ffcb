"""Cost of the distance between rim and outline for a population: one kernel per lens model."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from calib.jit import composed, kernel, prange
from calib.lenses.forward import brown_conrady_coefficients as coefficients
from calib.lenses.forward import distort, lens_parts
from calib.lenses.lens import LensModel

#: Bound of the normalised distance from the outline: beyond it, the outline may belong to something else.
FARTHEST = 8.0


def rim_cost(lens: LensModel) -> Callable[..., None]:
    """Kernel for a lens model; all kernels take the same arguments."""
    return composed(_rim_cost, **lens_parts(lens))


@kernel
def _rim_cost(
    vertices: NDArray[np.float32],
    deviation: float,
    outer: NDArray[np.intp],
    inner: NDArray[np.intp],
    beyond: NDArray[np.float32],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    limit: float,
    corner: NDArray[np.float32],
    inwards: NDArray[np.float32],
    out: NDArray[np.float64],
) -> None:
    """Half the sum of squared, bounded distances of the rim from the outline in units of σ.

    The distance is that of `rim.locate`, without its slopes.

    Args:
        vertices: (population, 3, n) [m].
        deviation: σ [px].
        outer, inner, beyond, pose, matrix, lens, limit, corner, inwards: as in `rim.locate`.
        out: costs (population,) [nats].
    """
    one, zero, farthest = np.float32(1), np.float32(0), np.float32(limit)
    (fx, fy, cx, cy), own_lens = matrix, coefficients(lens)
    height, width = inwards.shape
    last_column, last_row = np.float32(width - 1), np.float32(height - 1)
    per_deviation, most = 1 / deviation, FARTHEST**2
    pixels = inwards.reshape(-1)
    for k in prange(vertices.shape[0] if height > 1 and width > 1 else 0):
        total, xs, ys, zs = 0.0, vertices[k, 0], vertices[k, 1], vertices[k, 2]
        # No branches on what is inside the image: so all rim vertices are looked up at once.
        for v in range(np.uintp(outer.size)):
            i, j, share = np.uintp(outer[v]), np.uintp(inner[v]), beyond[v]
            a, b, c = xs[i] + share * (xs[i] - xs[j]), ys[i] + share * (ys[i] - ys[j]), zs[i] + share * (zs[i] - zs[j])
            x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
            y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
            z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
            inverse = one / z
            u, w = x * inverse, y * inverse
            bent_u, bent_w = distort(u, w, own_lens)
            column, row = fx * bent_u + cx - corner[0], fy * bent_w + cy - corner[1]
            seen = z > np.float32(1e-6) and u * u + w * w < farthest
            seen = seen and column >= zero and row >= zero and column < last_column and row < last_row
            column, row = (column if seen else zero), (row if seen else zero)
            at = np.int32(row) * np.int32(width) + np.int32(column)
            f, g = column - np.float32(np.int32(column)), row - np.float32(np.int32(row))
            first, below = np.uintp(at), np.uintp(at + np.int32(width))
            upper = (one - f) * pixels[first] + f * pixels[first + np.uintp(1)]
            lower = (one - f) * pixels[below] + f * pixels[below + np.uintp(1)]
            inside = np.float64((one - g) * upper + g * lower) * per_deviation
            square = inside * inside
            total += square if seen and square < most else most
        out[k] = 0.5 * total
    if height < 2 or width < 2:
        out[:] = 0.5 * most * outer.size
