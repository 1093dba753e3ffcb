"""Metric of changes of Θ: how far a change moves the surface, and how unsmoothly.

What the predicted motion misses is, as a rule, smooth: neighbouring control points are displaced alike. With the scales
s of the parameters (1 / s: metres per unit) and the model's roughness S, whose product with a change is a length, too,
the squared length of a change δ is δᵀ B δ with B = diag(s⁻²) + SᵀS. If S holds second differences, noise that differs
from control point to control point is up to some ten times longer than a motion that displaces all of them equally.
"""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


class ChangeMetric:
    """Squared length δᵀ B δ [m²] of changes δ of theta.

    Args:
        scales: change (dim,) of each parameter that moves the surface by about one metre.
        roughness: S (k, dim) [m per unit of the parameter].

    Attributes:
        matrix: B (dim, dim).
        root: C (dim, dim), upper triangular, with CᵀC = B.
        inverse: B⁻¹ (dim, dim).
    """

    def __init__(self, scales: NDArray[np.float64], roughness: NDArray[np.float64]):
        rows = np.concatenate([np.diag(1 / scales), roughness])
        self.matrix = rows.T @ rows
        self.root = np.asarray(np.linalg.cholesky(self.matrix).T, np.float64)
        self.inverse = np.asarray(np.linalg.inv(self.matrix), np.float64)
        row, self._columns = np.nonzero(rows)
        self._values = rows[row, self._columns]
        self._starts = np.searchsorted(row, np.arange(len(rows) + 1))

    def squares(self, thetas: NDArray[np.float64], center: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared lengths (population,) [m²] of the changes from center (dim,) to thetas (population, dim)."""
        out = np.empty(len(thetas))
        _squares(thetas, center, self._starts, self._columns, self._values, out)
        return out


@kernel
def _squares(
    thetas: NDArray[np.float64],
    center: NDArray[np.float64],
    starts: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """`_square` for every candidate of a population."""
    for k in range(thetas.shape[0]):
        out[k] = _square(thetas[k], center, starts, columns, values)


@kernel
def _square(
    theta: NDArray[np.float64],
    center: NDArray[np.float64],
    starts: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: NDArray[np.float64],
) -> float:
    """Squared length of a sparse matrix times Θ − center; its row r has `values` from starts[r] to starts[r + 1]."""
    total = 0.0
    for r in range(starts.size - 1):
        length = 0.0
        for e in range(starts[r], starts[r + 1]):
            length += values[e] * (theta[columns[e]] - center[columns[e]])
        total += length * length
    return total
