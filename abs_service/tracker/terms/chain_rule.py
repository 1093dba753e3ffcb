"""Kernels of the chain rule: derivatives with respect to points, times those of the points with respect to theta."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


@kernel
def count_points(points: NDArray[np.int64], group: NDArray[np.int32], start: NDArray[np.int64]) -> None:
    """First index of each group's residuals in sorted order, and their total, into zeros (groups + 1,)."""
    for m in range(points.size):
        start[group[points[m]] + 1] += 1
    for g in range(1, start.size):
        start[g] += start[g - 1]


@kernel
def apply_chain_rule(
    residual: NDArray[np.float64],
    rows: NDArray[np.float64],
    points: NDArray[np.int64],
    group: NDArray[np.int32],
    local: NDArray[np.float64],
    place: NDArray[np.int64],
    sorted_residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    sorted_points: NDArray[np.int64],
) -> None:
    """Rows times the Jacobians of their points, sorted by group; `place` is the first index of each group.

    A library needs ten times as long for thousands of products of 1 × 3 by 3 × k matrices.
    """
    for m in range(points.size):
        v = points[m]
        to = place[group[v]]
        place[group[v]] += 1
        sorted_residual[to], sorted_points[to] = residual[m], v
        x, y, z = rows[m, 0], rows[m, 1], rows[m, 2]
        for d in range(local.shape[2]):
            jacobian[to, d] = x * local[v, 0, d] + y * local[v, 1, d] + z * local[v, 2, d]


@kernel
def sum_at_points(
    rows: NDArray[np.float64], points: NDArray[np.int64], values: NDArray[np.float64], at_points: NDArray[np.float64]
) -> None:
    """Sum of rowᵀ times value (3, k) over the residuals of each point, into zeros (n, 3, k)."""
    for m in range(points.size):
        for i in range(3):
            total = at_points[points[m], i]
            for k in range(values.shape[1]):
                total[k] += rows[m, i] * values[m, k]


@kernel
def transpose_times(
    at_points: NDArray[np.float64],
    group: NDArray[np.int32],
    parameters: NDArray[np.int64],
    local: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Transposed Jacobian of the points times values at the points (n, 3, k), into zeros (dim, k)."""
    for v in range(group.size):
        own = parameters[group[v]]
        for d in range(own.size):
            total = result[own[d]]
            for i in range(3):
                for k in range(total.size):
                    total[k] += local[v, i, d] * at_points[v, i, k]
