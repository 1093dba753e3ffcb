"""Priors of stretch and motion, and that of the shape: negative log-densities of theta, without hand-tuned weights."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from abs_service.tracker.terms.linearization import Linearization
from calib.jit import kernel


@dataclass(frozen=True)
class Settings:
    """TOML keys of the priors.

    Attributes:
        stretch: standard deviation of an edge's relative change of length. Paper: 0.01; rubber: 0.2.
        speed: largest standard deviation of a parameter's rate of change around the predicted one, expressed as the
            speed of the surface that it moves [m/s]; it becomes smaller while the object moves as predicted.
        least_speed: smallest standard deviation of that rate, while the object moves as predicted [m/s].
        memory_s: time constant of the exponential decay of the predicted velocity [s].
    """

    stretch: Annotated[float, Gt(0)] = 0.02
    speed: Annotated[float, Gt(0)] = 0.3
    least_speed: Annotated[float, Gt(0)] = 0.02
    memory_s: Annotated[float, Gt(0)] = 0.1


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
    """`_half_square` for every candidate of a population."""
    for k in range(thetas.shape[0]):
        out[k] = _half_square(thetas[k], center, rows)


@kernel
def _half_square(theta: NDArray[np.float64], center: NDArray[np.float64], rows: NDArray[np.float64]) -> float:
    """Half the squared length of rows (k, dim) times Θ − center."""
    total = 0.0
    for r in range(rows.shape[0]):
        length = 0.0
        for d in range(center.size):
            length += rows[r, d] * (theta[d] - center[d])
        total += 0.5 * length * length
    return total
