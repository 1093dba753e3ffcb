"""Linearised residuals, each of which depends on the parameters of one group of points, such as a knot span."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


@dataclass(frozen=True, slots=True, eq=False)
class GroupedLinearization:
    """Normalised residuals, sorted by group, and their derivatives with respect to the parameters of their groups.

    All groups are treated in one kernel: a call for each of them takes longer than what there is to compute.

    Attributes:
        residual: (m,).
        jacobian: (m, k), contiguous.
        parameters: indices (groups, k) of the parameters of every group.
        start: first residual of every group, and the number of residuals, (groups + 1,).
        positions: of the points that they belong to (m, 3) [m]; empty (0, 3) if they belong to none.
        shared: see `Linearization`; (0, 0) if they share none.
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    parameters: NDArray[np.int64]
    start: NDArray[np.int64]
    positions: NDArray[np.floating] = field(default_factory=lambda: np.zeros((0, 3)))
    shared: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def dense(self, dimension: int) -> NDArray[np.float64]:
        """Jacobian (m, dimension) with respect to all parameters."""
        result, own = np.zeros((len(self.residual), dimension)), self.parameters.repeat(np.diff(self.start), axis=0)
        np.put_along_axis(result, own, self.jacobian, axis=1)
        return result

    def moved(self, by: NDArray[np.float64]) -> "GroupedLinearization":
        """Linearisation with its residuals extrapolated to first order by a step (dim,) of theta."""
        residual = np.empty_like(self.residual)
        _extrapolate(self.residual, self.jacobian, self.parameters, self.start, by, residual)
        return replace(self, residual=residual)

    def add_gradient(self, total: NDArray[np.float64]) -> None:
        """Adds Jᵀr to a gradient (dim,)."""
        _add_gradient(self.residual, self.jacobian, self.parameters, self.start, total)

    def add_curvature(self, total: NDArray[np.float64]) -> None:
        """Adds JᵀJ to a matrix (dim, dim)."""
        self.add_square(np.ones(len(self.residual)), total)

    def add_square(self, weights: NDArray[np.float64], total: NDArray[np.float64]) -> None:
        """Adds Jᵀ diag(weights) J, of weights (m,), to a matrix (dim, dim)."""
        _add_square(self.jacobian, weights, self.parameters, self.start, total)

    def leverage(self, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """diag(J Σ Jᵀ) (m,) of a covariance Σ (dim, dim)."""
        result = np.empty(len(self.residual))
        _quadratic_forms(self.jacobian, self.parameters, self.start, covariance, result)
        return result

    def add_scores(self, clusters: NDArray[np.int64], scores: NDArray[np.float64]) -> None:
        """Adds the score Jᵀr of every residual to that of its cluster (m,), one of the rows of `scores` (…, dim)."""
        add_scores(clusters, self.residual, self.jacobian, self.parameters, self.start, scores)


@kernel
def _extrapolate(
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    parameters: NDArray[np.int64],
    start: NDArray[np.int64],
    by: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Residuals plus rows times a step (dim,)."""
    step = np.empty(parameters.shape[1])
    for g in range(parameters.shape[0]):
        for d in range(step.size):
            step[d] = by[parameters[g, d]]
        for m in range(start[g], start[g + 1]):
            total = 0.0
            for d in range(step.size):
                total += jacobian[m, d] * step[d]
            result[m] = residual[m] + total


@kernel
def _add_gradient(
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    parameters: NDArray[np.int64],
    start: NDArray[np.int64],
    total: NDArray[np.float64],
) -> None:
    """Adds the residuals times their rows to the gradient (dim,)."""
    own = np.empty(parameters.shape[1])
    for g in range(parameters.shape[0]):
        own[:] = 0.0
        for m in range(start[g], start[g + 1]):
            for d in range(own.size):
                own[d] += residual[m] * jacobian[m, d]
        for d in range(own.size):
            total[parameters[g, d]] += own[d]


@kernel
def _add_square(
    rows: NDArray[np.float64],
    weights: NDArray[np.float64],
    parameters: NDArray[np.int64],
    start: NDArray[np.int64],
    total: NDArray[np.float64],
) -> None:
    """Adds rowᵀ weight row, of rows (m, k) with weights (m,), to a matrix (dim, dim).

    Of four blocks of the square, which is symmetric, one is not multiplied but mirrored.
    """
    k, half = rows.shape[1], rows.shape[1] // 2
    for g in range(parameters.shape[0]):
        n, own = start[g + 1] - start[g], parameters[g]
        if n == 0:
            continue
        first, second, right = np.empty((n, half)), np.empty((n, k - half)), np.empty((n, k - half))
        for m in range(n):
            row, weight = rows[start[g] + m], weights[start[g] + m]
            for d in range(half):
                first[m, d] = weight * row[d]
            for d in range(k - half):
                right[m, d] = row[half + d]
                second[m, d] = weight * row[half + d]
        upper, lower = np.dot(first.T, rows[start[g] : start[g + 1]]), np.dot(second.T, right)
        for i in range(half):
            line = total[own[i]]
            for j in range(k):
                line[own[j]] += upper[i, j]
        for i in range(half, k):
            line = total[own[i]]
            for j in range(half):
                line[own[j]] += upper[j, i]
            for j in range(half, k):
                line[own[j]] += lower[i - half, j - half]


@kernel
def _quadratic_forms(
    rows: NDArray[np.float64],
    parameters: NDArray[np.int64],
    start: NDArray[np.int64],
    matrix: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Products row matrix rowᵀ (m,) of rows (m, k) with a matrix (dim, dim)."""
    part = np.empty((parameters.shape[1], parameters.shape[1]))
    for g in range(parameters.shape[0]):
        if start[g] == start[g + 1]:
            continue
        for i in range(part.shape[0]):
            line = matrix[parameters[g, i]]
            for j in range(part.shape[1]):
                part[i, j] = line[parameters[g, j]]
        own = rows[start[g] : start[g + 1]]
        products = np.dot(own, part)
        for m in range(own.shape[0]):
            total = 0.0
            for d in range(own.shape[1]):
                total += products[m, d] * own[m, d]
            result[start[g] + m] = total


@kernel
def add_scores(
    clusters: NDArray[np.int64],
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    parameters: NDArray[np.int64],
    start: NDArray[np.int64],
    scores: NDArray[np.float64],
) -> None:
    """Adds residuals (m,) times their rows (m, k) to the rows of `scores` (…, dim) that `clusters` (m,) names."""
    for g in range(parameters.shape[0]):
        own = parameters[g]
        for m in range(start[g], start[g + 1]):
            score = scores[clusters[m]]
            for d in range(own.size):
                score[own[d]] += residual[m] * jacobian[m, d]
