"""Spline surfaces as one polynomial per knot span: half the work of summing base splines at every vertex."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models import spline
from abs_service.tracker.models.base import Surface
from abs_service.tracker.models.tiles import LANES, TILE, write
from calib.jit import kernel, prange


class Patches:
    """Vertices beside a rational spline surface, sorted by knot span.

    Within a span, numerator and denominator of eq. 2 are polynomials of degree d in each of two coordinates that run
    from −½ to ½ there. The numerator's (d + 1)² coefficients are linear in the span's control points, and all vertices
    of the span share them; the denominator belongs to the vertices alone.
    """

    def __init__(
        self,
        u: NDArray[np.float64],
        w: NDArray[np.float64],
        offset: NDArray[np.float64],
        weights: NDArray[np.float64],
        degree: int,
    ):
        """Takes surface parameters (n,), sorted by span, offsets (n,) [m] and the control points' weights.

        Args:
            u, w: surface parameters (n,) in [0, 1], in ascending order of the spans that `spline.support` numbers.
            offset: o of eq. 7 (n,) [m].
            weights: of the control points (rows, columns).
            degree: of the surface.
        """
        span, control = spline.support(u, w, weights.shape, degree)
        spans = np.subtract(weights.shape, degree)
        of_u, of_w = (spline.power_form(points, degree) for points in weights.shape)
        powers = np.einsum("ilp,jmq->ijlmpq", of_u, of_w).reshape(len(control), (degree + 1) ** 2, -1)
        self._powers = powers * weights.ravel()[control][:, None]
        self._control = control
        self._start = np.searchsorted(span, np.arange(len(control) + 1)).astype(np.int64)
        self._orders = (0,) * (degree + 1)
        place = np.clip([u, w], 0, 1) * spans[:, None] - np.divmod(span, spans[1]) - 0.5
        denominator = _polynomials(self._powers.sum(axis=2).reshape(-1, degree + 1, degree + 1)[span], *place)
        value, along_u, along_w = denominator
        self._vertices = np.zeros((6, len(u) + LANES), np.float32)
        self._vertices[:, : len(u)] = [*place, offset, 1 / value, along_u, along_w]

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Vertices and normals for every row of `thetas` (population, 3 · control points) [m]."""
        population, n = len(thetas), self._vertices.shape[1] - LANES
        shape = (*self._powers.shape[:2], 3, population)
        coefficients = np.empty(shape, np.float32)
        control = np.ascontiguousarray(thetas.T, np.float64).reshape(-1, 3 * population)
        _find_coefficients(control, self._control, self._powers, coefficients.reshape(*shape[:2], -1))
        vertices, normals = np.empty((population, 3, n), np.float32), np.empty((population, 3, n), np.float32)
        _evaluate(coefficients, self._start, self._vertices, self._orders, vertices, normals)
        return Surface(vertices, normals)

    def raise_vertices(self, by: NDArray[np.float64]) -> None:
        """Adds lengths (n,) [m] to the offsets."""
        self._vertices[2, : len(by)] += by.astype(np.float32)


def _polynomials(
    coefficients: NDArray[np.float64], u: NDArray[np.float64], w: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Values of n polynomials (n, d + 1, d + 1) at u and w (n,), and their derivatives by u and by w."""
    powers = np.arange(coefficients.shape[1])
    (of_u, by_u), (of_w, by_w) = (
        (at[:, None] ** powers, powers * at[:, None] ** np.maximum(powers - 1, 0)) for at in (u, w)
    )
    value, along_u, along_w = (
        np.einsum("nlm,nl,nm->n", coefficients, a, b) for a, b in ((of_u, of_w), (by_u, of_w), (of_u, by_w))
    )
    return value, along_u, along_w


@kernel
def _find_coefficients(
    control: NDArray[np.float64],
    span_control: NDArray[np.int32],
    powers: NDArray[np.float64],
    coefficients: NDArray[np.float32],
) -> None:
    """Coefficients (spans, q, 3 · population) of all members at once, in double precision: they are differences.

    Args:
        control: (control points, 3 · population).
        span_control: control points of every span (spans, q).
        powers: every coefficient's share of each control point (spans, q, q).
        coefficients: results.
    """
    row = np.empty(control.shape[1])
    for s in range(powers.shape[0]):
        for power in range(powers.shape[1]):
            row[:] = 0
            for q in range(powers.shape[2]):
                share, point = powers[s, power, q], control[span_control[s, q]]
                if share != 0:
                    for k in range(row.size):
                        row[k] += share * point[k]
            coefficients[s, power] = row


@kernel
def _polynomial(
    coefficients: NDArray[np.float32], orders: tuple[int, ...], u: np.float32, w: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Value and derivatives by u and by w, by Horner's rule, of coefficients as in `_evaluate`."""
    size, value, by_u, by_w = len(orders), np.float32(0), np.float32(0), np.float32(0)
    for i in range(size):
        row, slope = coefficients[(size - i) * size - 1], np.float32(0)
        # Nothing is multiplied by 0 to begin with: since that could be NaN, the compiler would not leave it out.
        for j in range(1, size):
            slope = slope * w + row if j > 1 else row
            row = row * w + coefficients[(size - i) * size - 1 - j]
        by_u = by_u * u + value if i > 1 else value
        value = value * u + row if i > 0 else row
        by_w = by_w * u + slope if i > 0 else slope
    return value, by_u, by_w


@kernel
def _evaluate(
    coefficients: NDArray[np.float32],
    start: NDArray[np.int64],
    places: NDArray[np.float32],
    orders: tuple[int, ...],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Eq. 8 for a population.

    Args:
        coefficients: of the numerator (spans, (d + 1)², 3, population), powers of w within those of u.
        start: first vertex of every span, and the number of vertices, (spans + 1,).
        places: u, w, offset, 1 / denominator and its derivatives by u and by w (6, n + `LANES`).
        orders: as long as a polynomial; the compiler knows a tuple's length and so unrolls what runs over it.
        vertices, normals: results (population, 3, n).
    """
    one, n = np.float32(1), vertices.shape[2]
    for k in prange(vertices.shape[0]):
        result, c = np.empty((6, TILE + LANES), np.float32), np.empty((3, coefficients.shape[1]), np.float32)
        cx, cy, cz, s = c[0], c[1], c[2], 0
        for first in range(0, n, TILE):
            last = min(first + TILE, n)
            begin = first
            while begin < last:
                while start[s + 1] <= begin:
                    s += 1
                end = min(start[s + 1], last)
                for q in range(cx.size):
                    cx[q], cy[q], cz[q] = coefficients[s, q, 0, k], coefficients[s, q, 1, k], coefficients[s, q, 2, k]
                u, w, offset = places[0, begin:], places[1, begin:], places[2, begin:]
                share, by_u, by_w = places[3, begin:], places[4, begin:], places[5, begin:]
                shift, lanes = np.uintp(begin - first), np.uintp((end - begin + LANES - 1) // LANES * LANES)
                for v in range(lanes):
                    x, ux, wx = _polynomial(cx, orders, u[v], w[v])
                    y, uy, wy = _polynomial(cy, orders, u[v], w[v])
                    z, uz, wz = _polynomial(cz, orders, u[v], w[v])
                    x, y, z = x * share[v], y * share[v], z * share[v]
                    ux, uy, uz = ux - x * by_u[v], uy - y * by_u[v], uz - z * by_u[v]
                    wx, wy, wz = wx - x * by_w[v], wy - y * by_w[v], wz - z * by_w[v]
                    a, b, d = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
                    inverse = one / np.sqrt(a * a + b * b + d * d + np.float32(1e-20))
                    a, b, d = a * inverse, b * inverse, d * inverse
                    x, y, z = x + a * offset[v], y + b * offset[v], z + d * offset[v]
                    at = shift + v
                    result[0, at], result[1, at], result[2, at] = x, y, z
                    result[3, at], result[4, at], result[5, at] = a, b, d
                begin = end
            write(result, first, last - first, vertices[k], normals[k])
