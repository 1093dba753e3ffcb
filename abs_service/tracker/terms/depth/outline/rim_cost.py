"""Cost of the distance between rim and outline for a population: one kernel per lens model."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Optics
from abs_service.tracker.terms.depth.outline.rim import Edges
from calib.jit import composed, kernel
from calib.lenses.forward import brown_conrady_coefficients as coefficients
from calib.lenses.forward import distort, lens_parts
from calib.lenses.lens import LensModel

#: Bound of the normalised distance from the outline: beyond it, the outline may belong to something else.
MAX_DEVIATIONS = 8.0

#: Number of rim vertices that are gathered first, and then compared at once.
_TILE = 64


def rim_cost(lens: LensModel) -> Callable[..., None]:
    """Kernel for a lens model; all kernels take the same arguments."""
    return composed(_rim_cost, **lens_parts(lens))


@kernel
def _rim_cost(
    vertices: NDArray[np.float32],
    edges: Edges,
    optics: Optics,
    inwards: NDArray[np.float32],
    corner: NDArray[np.float32],
    deviation: float,
    out: NDArray[np.float64],
) -> None:
    """Half the sum of squared, bounded distances of the rim from the outline in units of σ.

    The distance is that of `rim.look_up`, without its gradients.

    Args:
        vertices: (population, 3, n) [m].
        edges: of the rim.
        optics: of the camera.
        inwards, corner: distances (rows, columns) [px] and their first pixel, see `OutlineImage`.
        deviation: σ [px].
        out: costs (population,) [nats].
    """
    one, zero, farthest = np.float32(1), np.float32(0), np.float32(optics.limit)
    (fx, fy, cx, cy), own_lens, pose = optics.matrix, coefficients(optics.lens), optics.pose
    outer, inner, beyond = edges
    last_row, last_column = np.float32(inwards.shape[0] - 1), np.float32(inwards.shape[1] - 1)
    pixels, stride, width = inwards.reshape(-1), np.int32(inwards.shape[1]), np.uintp(inwards.shape[1])
    most, per_deviation = np.float32(MAX_DEVIATIONS**2), np.float32(1 / deviation)
    far = 0.0 if last_row > 0 and last_column > 0 else most * outer.size  # there is no pixel between others
    # Gathered first: with that in the same loop, the rest would not be computed for many at once.
    tile, at, seen = np.empty((8, _TILE), np.float32), np.empty(_TILE, np.int32), np.empty(_TILE, np.bool_)
    for k in range(vertices.shape[0]):
        total, xs, ys, zs = far, vertices[k, 0], vertices[k, 1], vertices[k, 2]
        for first in range(0, 0 if far > 0 else outer.size, _TILE):
            count = np.uintp(min(_TILE, outer.size - first))
            ends, inside, beyond_it = outer[first:], inner[first:], beyond[first:]
            for v in range(count):
                i, j = np.uintp(ends[v]), np.uintp(inside[v])
                a, b, c, d, e, f = xs[i], ys[i], zs[i], xs[j], ys[j], zs[j]
                tile[0, v], tile[1, v], tile[2, v], tile[3, v], tile[4, v], tile[5, v] = a, b, c, d, e, f
            for v in range(count):
                share, a, b, c = beyond_it[v], tile[0, v], tile[1, v], tile[2, v]
                a, b, c = a + share * (a - tile[3, v]), b + share * (b - tile[4, v]), c + share * (c - tile[5, v])
                x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
                y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
                z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
                inverse = one / z
                u, w = x * inverse, y * inverse
                bent_u, bent_w = distort(u, w, own_lens)
                column, row = fx * bent_u + cx - corner[0], fy * bent_w + cy - corner[1]
                known = z > np.float32(1e-6) and u * u + w * w < farthest
                known = known and column >= zero and row >= zero and column < last_column and row < last_row
                column, row, seen[v] = (column if known else zero), (row if known else zero), known
                at[v] = np.int32(row) * stride + np.int32(column)
                tile[6, v], tile[7, v] = column - np.float32(np.int32(column)), row - np.float32(np.int32(row))
            for v in range(count):
                above = np.uintp(at[v])
                below, right = above + width, np.uintp(1)
                a, b, c, d = pixels[above], pixels[above + right], pixels[below], pixels[below + right]
                tile[0, v], tile[1, v], tile[2, v], tile[3, v] = a, b, c, d
            part = zero
            for v in range(count):
                a, b, c, d, across, down = tile[0, v], tile[1, v], tile[2, v], tile[3, v], tile[6, v], tile[7, v]
                upper, lower = a + across * (b - a), c + across * (d - c)
                distance = (upper + down * (lower - upper)) * per_deviation
                square = distance * distance
                part += square if seen[v] and square < most else most  # also where it is NaN
            total += part
        out[k] = 0.5 * total
