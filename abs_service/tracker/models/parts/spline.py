"""B-spline basis functions of NURBS surfaces and their derivatives (eqs. 3–5)."""

import math

import numpy as np
from numpy.typing import NDArray

Basis = NDArray[np.float64]


def clamped_knots(control_points: int, degree: int) -> NDArray[np.float64]:
    """Uniform knots in [0, 1], clamped at both ends, (control_points + degree + 1,)."""
    inner = np.linspace(0.0, 1.0, control_points - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.ones(degree)])


def base_splines(u: NDArray[np.floating], control_points: int, degree: int, derivative: int = 0) -> Basis:
    """Basis functions n_{i,d}(u) of eqs. 4 and 5, or a derivative, (len(u), control_points); u = 1 is included."""
    knots = clamped_knots(control_points, degree)
    u = np.clip(u, 0.0, 1.0)
    basis = np.eye(control_points + degree)[degree + _spans(u, control_points, degree)]
    for d in range(1, degree + 1):
        length = knots[d : d + basis.shape[1]] - knots[: basis.shape[1]]
        per_length = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0)
        if d > degree - derivative:
            lower = d * per_length * basis
            basis = lower[:, :-1] - lower[:, 1:]
        else:
            rising = (u[:, None] - knots[: basis.shape[1]]) * per_length
            basis = rising[:, :-1] * basis[:, :-1] + (1.0 - rising[:, 1:]) * basis[:, 1:]
    return basis


def rational_basis(
    u: NDArray[np.floating], w: NDArray[np.floating], degree: int, weights: NDArray[np.float64]
) -> tuple[Basis, Basis, Basis]:
    """Rational basis functions R_p of eq. 3 and their derivatives ∂R/∂u, ∂R/∂w, each (n, rows × columns).

    Args:
        u, w: surface parameters (n,) in [0, 1].
        degree: polynomial degree d in both directions.
        weights: weight of every control point (rows, columns); rows follow u, columns follow w.
    """
    rows, columns = weights.shape
    n_u, n_w = base_splines(u, rows, degree), base_splines(w, columns, degree)
    d_u, d_w = base_splines(u, rows, degree, 1), base_splines(w, columns, degree, 1)
    value, along_u, along_w = (
        (np.einsum("ni,nj->nij", a, b) * weights).reshape(len(u), -1) for a, b in ((n_u, n_w), (d_u, n_w), (n_u, d_w))
    )
    total, total_u, total_w = (b.sum(axis=1, keepdims=True) for b in (value, along_u, along_w))
    basis = value / total
    return basis, (along_u - basis * total_u) / total, (along_w - basis * total_w) / total


def power_form(control_points: int, degree: int) -> NDArray[np.float64]:
    """Basis functions as polynomials per knot span, in a local coordinate from −½ to ½.

    Returns:
        Coefficients (spans, degree + 1, degree + 1), in ascending powers, of the basis functions that are not zero in
        the span.
    """
    spans = control_points - degree
    middle = (np.arange(spans) + 0.5) / spans
    taylor = [
        base_splines(middle, control_points, degree, m) / (math.factorial(m) * spans**m) for m in range(degree + 1)
    ]
    reaching = np.arange(spans)[:, None] + np.arange(degree + 1)
    return np.stack([np.take_along_axis(row, reaching, axis=1) for row in taylor], axis=1)


def support(
    u: NDArray[np.floating], w: NDArray[np.floating], shape: tuple[int, int], degree: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Knot span (n,) of every vertex, row by row, and the control points (spans, (degree + 1)²) of each span."""
    rows, columns = shape
    spans_u, spans_w = rows - degree, columns - degree
    i, j = _spans(u, rows, degree), _spans(w, columns, degree)
    corner = np.arange(degree + 1)
    local = (corner[:, None] * columns + corner).ravel()
    first = (np.arange(spans_u)[:, None] * columns + np.arange(spans_w)).ravel()
    return (i * spans_w + j).astype(np.int32), (first[:, None] + local).astype(np.int32)


def _spans(u: NDArray[np.floating], control_points: int, degree: int) -> NDArray[np.int32]:
    """Knot span of every parameter (n,), found by comparison with the knots: u · spans may round across one."""
    inner = clamped_knots(control_points, degree)[degree + 1 : -degree - 1]
    return np.searchsorted(inner, u, side="right").astype(np.int32)
