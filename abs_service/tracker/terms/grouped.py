"""Linearised residuals, each of which depends on the parameters of one group of points, such as a knot span."""

from dataclasses import dataclass
from itertools import pairwise

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
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    parameters: NDArray[np.int64]
    start: NDArray[np.int64]

    def dense(self, dimension: int) -> NDArray[np.float64]:
        """Jacobian (m, dimension) with respect to all parameters."""
        result, own = np.zeros((len(self.residual), dimension)), self.parameters.repeat(np.diff(self.start), axis=0)
        np.put_along_axis(result, own, self.jacobian, axis=1)
        return result

    def add_gradient(self, total: NDArray[np.float64]) -> None:
        """Adds Jᵀr to a gradient (dim,)."""
        _add_gradient(self.residual, self.jacobian, self.parameters, self.start, total)

    def add_curvature(self, total: NDArray[np.float64]) -> None:
        """Adds JᵀJ to a matrix (dim, dim)."""
        add_group_squares(self.jacobian, self.parameters, self.start, total)


def add_group_squares(
    rows: NDArray[np.float64], parameters: NDArray[np.int64], start: NDArray[np.int64], total: NDArray[np.float64]
) -> None:
    """Adds rowᵀ row, of the rows (m, k) of every group, to its parameters' part of a matrix (dim, dim).

    NumPy computes half of a product of a matrix with itself, Numba all of it. Arguments as in `GroupedLinearization`.
    """
    squares = np.empty((len(parameters), rows.shape[1], rows.shape[1]))
    for square, (first, last) in zip(squares, pairwise(start.tolist()), strict=True):
        own = rows[first:last]
        np.matmul(own.T, own, out=square)
    _add_at(squares, parameters, total)


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
def _add_at(squares: NDArray[np.float64], parameters: NDArray[np.int64], total: NDArray[np.float64]) -> None:
    """Adds the squares of all groups (groups, k, k) to the rows and columns of their parameters in a matrix."""
    for g in range(parameters.shape[0]):
        own = parameters[g]
        for i in range(own.size):
            line = total[own[i]]
            for j in range(own.size):
                line[own[j]] += squares[g, i, j]
