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
        self._lower = np.asarray(np.linalg.cholesky(self.matrix), np.float64)
        self.root = self._lower.T
        self.inverse = np.asarray(np.linalg.inv(self.matrix), np.float64)

    def squares(self, thetas: NDArray[np.float64], center: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared lengths (population,) [m²] of the changes from center (dim,) to thetas (population, dim)."""
        out = np.empty(len(thetas))
        _squares(thetas, center, self._lower, out)
        return out


@kernel
def _squares(
    thetas: NDArray[np.float64], center: NDArray[np.float64], lower: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Squared lengths (population,) of lowerᵀ (Θ − center), with a lower triangular matrix (dim, dim)."""
    length = np.empty(center.size)
    for k in range(thetas.shape[0]):
        length[:] = 0.0
        for d in range(center.size):
            change = thetas[k, d] - center[d]
            for e in range(d + 1):  # along a row of memory, one lane for each element
                length[e] += change * lower[d, e]
        total = 0.0
        for e in range(center.size):
            total += length[e] * length[e]
        out[k] = total
