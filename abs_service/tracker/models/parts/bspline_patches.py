"""Spline surfaces as one polynomial per knot span, at half the cost of summing basis functions at every vertex."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.models.parts import spline
from abs_service.tracker.models.parts.tile_buffer import LANES, TILE, write
from calib.jit import composed, kernel, prange


class Patches:
    """Vertices bound to a rational spline surface, sorted by knot span.

    Within a span, numerator and denominator of eq. 2 are polynomials of degree d in each of two local coordinates from
    −½ to ½. The numerator's (d + 1)² coefficients are linear in the span's control points and shared by all vertices of
    the span; the denominator depends on the vertices only and is computed once.
    """

    def __init__(
        self,
        u: NDArray[np.float64],
        w: NDArray[np.float64],
        offset: NDArray[np.float64],
        weights: NDArray[np.float64],
        degree: int,
    ):
        """Precomputes the polynomials of the vertices.

        Args:
            u, w: surface parameters (n,) in [0, 1], in ascending order of the spans that `spline.support` numbers.
            offset: o of eq. 7 (n,) [m].
            weights: weights of the control points (rows, columns).
            degree: degree of the surface.
        """
        span, control = spline.support(u, w, weights.shape, degree)
        spans = np.subtract(weights.shape, degree)
        of_u, of_w = (spline.power_form(points, degree) for points in weights.shape)
        powers = np.einsum("ilp,jmq->ijpqlm", of_u, of_w).reshape(*control.shape, -1)
        powers *= weights.ravel()[control][:, :, None]
        self._powers = np.pad(powers, ((0, 0), (0, 0), (0, -powers.shape[2] % LANES))).astype(np.float32)
        self._control = control
        self._start = np.searchsorted(span, np.arange(len(control) + 1)).astype(np.int64)
        evaluate = composed(_evaluate, _polynomial=composed(_polynomial, ORDERS=degree + 1))
        self._deform = composed(_deform, _evaluate=evaluate)
        place = np.clip([u, w], 0, 1) * spans[:, None] - np.divmod(span, spans[1]) - 0.5
        denominator = _polynomials(powers.sum(axis=1).reshape(-1, degree + 1, degree + 1)[span], *place)
        value, along_u, along_w = denominator
        self._vertices = np.zeros((6, len(u) + LANES), np.float32)
        self._vertices[:, : len(u)] = [*place, offset, 1 / value, along_u, along_w]

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Vertices and normals for every row of `thetas` (population, 3 · control points) [m]."""
        shape = len(thetas), 3, self._vertices.shape[1] - LANES
        surface = Surface(np.empty(shape, np.float32), np.empty(shape, np.float32))
        spans = self._control, self._powers, self._start
        self._deform(thetas, *spans, self._vertices, surface.vertices, surface.normals)
        return surface

    def set_offsets(self, offset: NDArray[np.float64]) -> None:
        """Replaces the vertex offsets (n,) [m]."""
        self._vertices[2, : len(offset)] = offset


def _polynomials(
    coefficients: NDArray[np.float64], u: NDArray[np.float64], w: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Values of n polynomials (n, d + 1, d + 1) at u and w (n,), and their derivatives with respect to u and w."""
    powers = np.arange(coefficients.shape[1])
    (of_u, by_u), (of_w, by_w) = (
        (at[:, None] ** powers, powers * at[:, None] ** np.maximum(powers - 1, 0)) for at in (u, w)
    )
    value, along_u, along_w = (
        np.einsum("nlm,nl,nm->n", coefficients, a, b) for a, b in ((of_u, of_w), (by_u, of_w), (of_u, by_w))
    )
    return value, along_u, along_w


#: Number of polynomial coefficients; a compile-time constant, so that loops over them are unrolled.
ORDERS = 3


@kernel
def _find_coefficients(
    control: NDArray[np.float64],
    span_control: NDArray[np.int32],
    powers: NDArray[np.float32],
    coefficients: NDArray[np.float32],
) -> None:
    """Coefficients (spans, 3, q…) of x, y and z relative to the first control point.

    The relative coordinates are small, so single precision suffices: its rounding is below that of the final vertices.

    Args:
        control: one candidate's parameters (3 · control points,).
        span_control: control points of every span (spans, q).
        powers: contribution of each control point to each coefficient (spans, q, q…), zero-padded to a multiple of
            `LANES`.
        coefficients: results.
    """
    lanes = np.uintp(powers.shape[2] // LANES * LANES)
    coefficients[:] = 0
    for s in range(powers.shape[0]):
        x, y, z = coefficients[s, 0], coefficients[s, 1], coefficients[s, 2]
        for p in range(powers.shape[1]):
            first, shares = 3 * span_control[s, p], powers[s, p]
            px = np.float32(control[first] - control[0])
            py = np.float32(control[first + 1] - control[1])
            pz = np.float32(control[first + 2] - control[2])
            for q in range(lanes):
                x[q] += shares[q] * px
                y[q] += shares[q] * py
                z[q] += shares[q] * pz


@kernel
def _polynomial(
    coefficients: NDArray[np.float32], u: np.float32, w: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Value and derivatives with respect to u and w by Horner's rule, for coefficients as in `_evaluate`."""
    value, by_u, by_w = np.float32(0), np.float32(0), np.float32(0)
    for i in range(ORDERS):
        row, slope = coefficients[(ORDERS - i) * ORDERS - 1], np.float32(0)
        # Starts at 1: the compiler cannot remove a multiplication by an initial 0, because the product may be NaN.
        for j in range(1, ORDERS):
            slope = slope * w + row if j > 1 else row
            row = row * w + coefficients[(ORDERS - i) * ORDERS - 1 - j]
        by_u = by_u * u + value if i > 1 else value
        value = value * u + row if i > 0 else row
        by_w = by_w * u + slope if i > 0 else slope
    return value, by_u, by_w


@kernel
def _evaluate(
    coefficients: NDArray[np.float32],
    origin: NDArray[np.float64],
    start: NDArray[np.int64],
    places: NDArray[np.float32],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Eq. 8 for one candidate.

    Args:
        coefficients: of the numerator's x, y and z (spans, 3, (d + 1)²…), powers of w varying fastest.
        origin: point (3…) [m] to which the coefficients are relative.
        start: first vertex of every span, and the number of vertices, (spans + 1,).
        places: u, w, offset, 1 / denominator and its derivatives with respect to u and w (6, n + `LANES`).
        vertices, normals: results (3, n).
    """
    one, n, s = np.float32(1), vertices.shape[1], 0
    ox, oy, oz = np.float32(origin[0]), np.float32(origin[1]), np.float32(origin[2])
    result = np.empty((6, TILE + LANES), np.float32)
    for first in range(0, n, TILE):
        last = min(first + TILE, n)
        begin = first
        while begin < last:
            while start[s + 1] <= begin:
                s += 1
            end = min(start[s + 1], last)
            cx, cy, cz = coefficients[s, 0], coefficients[s, 1], coefficients[s, 2]
            u, w, offset = places[0, begin:], places[1, begin:], places[2, begin:]
            share, by_u, by_w = places[3, begin:], places[4, begin:], places[5, begin:]
            shift, lanes = np.uintp(begin - first), np.uintp((end - begin + LANES - 1) // LANES * LANES)
            for v in range(lanes):
                x, ux, wx = _polynomial(cx, u[v], w[v])
                y, uy, wy = _polynomial(cy, u[v], w[v])
                z, uz, wz = _polynomial(cz, u[v], w[v])
                x, y, z = x * share[v], y * share[v], z * share[v]
                ux, uy, uz = ux - x * by_u[v], uy - y * by_u[v], uz - z * by_u[v]
                wx, wy, wz = wx - x * by_w[v], wy - y * by_w[v], wz - z * by_w[v]
                a, b, d = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
                inverse = one / np.sqrt(a * a + b * b + d * d + np.float32(1e-20))
                a, b, d = a * inverse, b * inverse, d * inverse
                x, y, z = ox + x + a * offset[v], oy + y + b * offset[v], oz + z + d * offset[v]
                at = shift + v
                result[0, at], result[1, at], result[2, at] = x, y, z
                result[3, at], result[4, at], result[5, at] = a, b, d
            begin = end
        write(result, first, last - first, vertices, normals)


@kernel
def _deform(
    thetas: NDArray[np.float64],
    span_control: NDArray[np.int32],
    powers: NDArray[np.float32],
    start: NDArray[np.int64],
    places: NDArray[np.float32],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Vertices and normals (population, 3, n) for thetas (population, dim)."""
    for k in prange(thetas.shape[0]):
        coefficients = np.empty((powers.shape[0], 3, powers.shape[2]), np.float32)
        _find_coefficients(thetas[k], span_control, powers, coefficients)
        _evaluate(coefficients, thetas[k], start, places, vertices[k], normals[k])
