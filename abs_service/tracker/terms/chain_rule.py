"""Kernels of the chain rule: derivatives with respect to points, times those of the points with respect to theta.

Residuals of one point are added up before they meet its Jacobian D (3, k), which is much larger than their rows. Points
of a group that follow each other share one product of matrices: a library needs ten times as long for thousands of
products of 3 × 3 by 3 × k.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import JacobianBlocks
from calib.jit import kernel

#: Share of its trace below which what is left of a point's matrix is rounding.
_ROUNDING = 1e-15


@kernel
def sum_at_points(
    rows: NDArray[np.float64], points: NDArray[np.int64], values: NDArray[np.float64], at_points: NDArray[np.float64]
) -> None:
    """Adds rowᵀ times value (3, k) of every residual to that of its point (n, 3, k)."""
    for m in range(points.size):
        for i in range(3):
            total = at_points[points[m], i]
            for k in range(values.shape[1]):
                total[k] += rows[m, i] * values[m, k]


@kernel
def transpose_times(
    at_points: NDArray[np.float64],
    jacobian: JacobianBlocks,
    result: NDArray[np.float64],
) -> None:
    """Adds the transposed Jacobian of the points times values at the points (n, 3, k) to a matrix (dim, k)."""
    group, parameters, local = jacobian
    own, first = np.empty(local.shape[2]), 0
    while first < group.size:
        last = first + 1
        while last < group.size and group[last] == group[first]:
            last += 1
        for k in range(result.shape[1]):
            own[:] = 0.0
            for v in range(first, last):
                x, y, z = at_points[v, 0, k], at_points[v, 1, k], at_points[v, 2, k]
                for d in range(own.size):
                    own[d] += x * local[v, 0, d] + y * local[v, 1, d] + z * local[v, 2, d]
            for d in range(own.size):
                result[parameters[group[first], d], k] += own[d]
        first = last


@kernel
def sum_squares(
    rows: NDArray[np.float64], points: NDArray[np.int64], weights: NDArray[np.float64], squares: NDArray[np.float64]
) -> None:
    """Adds rowᵀ weight row (3, 3) of every residual to that of its point (n, 3, 3)."""
    for m in range(points.size):
        square = squares[points[m]]
        for i in range(3):
            for j in range(3):
                square[i, j] += weights[m] * rows[m, i] * rows[m, j]


@kernel
def find_roots(
    squares: NDArray[np.float64],
    jacobian: JacobianBlocks,
    rows: NDArray[np.float64],
    start: NDArray[np.int64],
    groups: NDArray[np.int64],
) -> int:
    """Rows whose square is DᵀMD of points with matrices M (n, 3, 3), symmetric and not negative; uses M up.

    M is CᵀC with as many rows C as its rank, by a Cholesky decomposition with pivots, and DᵀMD the square of CD.

    Args:
        squares: M.
        jacobian: D.
        rows: result (3 n, k) at most, by the parameters of their points' group.
        start: result, first row of points of a group that follow each other, and the number of rows, (n + 1,) at most.
        groups: result, their group (n,) at most.

    Returns:
        Number of times that points of a group follow each other.
    """
    group, _, local = jacobian
    row, count, runs = np.empty(3), 0, 0
    for v in range(group.size):
        if v == 0 or group[v] != group[v - 1]:
            start[runs], groups[runs] = count, group[v]
            runs += 1
        rest = squares[v]
        least = _ROUNDING * (rest[0, 0] + rest[1, 1] + rest[2, 2])
        for _ in range(3):
            p = 0 if rest[0, 0] >= max(rest[1, 1], rest[2, 2]) else (1 if rest[1, 1] >= rest[2, 2] else 2)
            if not rest[p, p] > least:
                break
            inverse = 1 / np.sqrt(rest[p, p])
            for i in range(3):
                row[i] = rest[p, i] * inverse
            for i in range(3):
                for j in range(3):
                    rest[i, j] -= row[i] * row[j]
            x, y, z = row
            for d in range(local.shape[2]):
                rows[count, d] = x * local[v, 0, d] + y * local[v, 1, d] + z * local[v, 2, d]
            count += 1
    start[runs] = count
    return runs


@kernel
def extrapolate(
    residual: NDArray[np.float64],
    rows: NDArray[np.float64],
    points: NDArray[np.int64],
    jacobian: JacobianBlocks,
    by: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Residuals plus rows times what a step (dim,) of theta moves their points by."""
    group, parameters, local = jacobian
    moved, step = np.empty((group.size, 3)), np.empty(local.shape[2])
    for v in range(group.size):
        if v == 0 or group[v] != group[v - 1]:
            for d in range(step.size):
                step[d] = by[parameters[group[v], d]]
        for i in range(3):
            total = 0.0
            for d in range(step.size):
                total += local[v, i, d] * step[d]
            moved[v, i] = total
    for m in range(points.size):
        by_point = moved[points[m]]
        result[m] = residual[m] + rows[m, 0] * by_point[0] + rows[m, 1] * by_point[1] + rows[m, 2] * by_point[2]


@kernel
def propagate(jacobian: JacobianBlocks, covariance: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """Covariance D Σ Dᵀ (n, 3, 3) of every point, from Σ (dim, dim); in single precision, in half the time.

    Points of a group that follow each other share one product of matrices.
    """
    (group, parameters, local), first = jacobian, 0
    part = np.empty((local.shape[2], local.shape[2]), np.float32)
    while first < group.size:
        own, last = parameters[group[first]], first + 1
        while last < group.size and group[last] == group[first]:
            last += 1
        for i in range(own.size):
            line = covariance[own[i]]
            for j in range(own.size):
                part[i, j] = line[own[j]]
        rows = local[first:last].astype(np.float32).reshape((3 * (last - first), own.size))
        products = np.empty_like(rows)
        np.dot(rows, part, products)
        for v in range(last - first):
            square = result[first + v]
            for i in range(3):
                for j in range(i, 3):
                    total = np.float32(0)
                    for d in range(own.size):
                        total += products[3 * v + i, d] * rows[3 * v + j, d]
                    square[i, j] = square[j, i] = total
        first = last


@kernel
def find_leverages(
    rows: NDArray[np.float64], points: NDArray[np.int64], at_points: NDArray[np.float64], result: NDArray[np.float64]
) -> None:
    """Row C rowᵀ (m,) of residuals with rows (m, 3), from the covariances C (n, 3, 3) of their points (m,)."""
    for m in range(points.size):
        square, total = at_points[points[m]], 0.0
        for i in range(3):
            for j in range(3):
                total += rows[m, i] * square[i, j] * rows[m, j]
        result[m] = total


@kernel
def add_scores(
    clusters: NDArray[np.int64],
    residual: NDArray[np.float64],
    rows: NDArray[np.float64],
    points: NDArray[np.int64],
    jacobian: JacobianBlocks,
    scores: NDArray[np.floating],
) -> None:
    """Adds residual row D of every residual to the row of `scores` (…, dim) that its cluster (m,) names."""
    (group, parameters, local), x, y, z = jacobian, 0.0, 0.0, 0.0
    for m in range(points.size):
        x, y, z = x + residual[m] * rows[m, 0], y + residual[m] * rows[m, 1], z + residual[m] * rows[m, 2]
        v = points[m]
        if m + 1 < points.size and points[m + 1] == v and clusters[m + 1] == clusters[m]:
            continue  # another channel of the same point
        score, own = scores[clusters[m]], parameters[group[v]]
        for d in range(own.size):
            score[own[d]] += x * local[v, 0, d] + y * local[v, 1, d] + z * local[v, 2, d]
        x = y = z = 0.0


@kernel
def add_dense_scores(
    clusters: NDArray[np.int64],
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    scores: NDArray[np.floating],
) -> None:
    """The same from a Jacobian (m, dim) with respect to all parameters."""
    for m in range(clusters.size):
        score = scores[clusters[m]]
        for d in range(score.size):
            score[d] += residual[m] * jacobian[m, d]
