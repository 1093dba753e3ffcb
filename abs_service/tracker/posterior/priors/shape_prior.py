"""Prior of the shape: the negative log-density of theta that a deformation model states."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.linearization import Linearization
from calib.jit import kernel


class ShapePrior:
    """Shape prior of the model: W (Θ − Θ⁰) is standard normal, W being the model's `prior`."""

    def __init__(self, rest: NDArray[np.float64], prior: NDArray[np.float64]):
        self._rest = rest
        self._prior = prior

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        out = np.empty(len(thetas))
        _half_squares(thetas, self._rest, self._prior, out)
        return out

    def linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """The normalised residuals of parameters (dim,), and their derivatives, which are constant."""
        return Linearization(self._prior @ (theta - self._rest), self._prior)


@kernel
def _half_squares(
    thetas: NDArray[np.float64], center: NDArray[np.float64], rows: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Half the squared length of rows (m, dim) times Θ − center, for every candidate."""
    for k in range(thetas.shape[0]):
        total = 0.0
        for r in range(rows.shape[0]):
            length = 0.0
            for d in range(center.size):
                length += rows[r, d] * (thetas[k, d] - center[d])
            total += 0.5 * length * length
        out[k] = total
