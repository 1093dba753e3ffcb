"""Priors of shape and motion: negative log-densities of theta, without hand-tuned weights."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from abs_service.tracker.terms.linearization import Linearization
from calib.jit import kernel

#: Radius of the search around the prediction, in standard deviations of the motion prior.
FARTHEST = 4.0

#: Interval assumed before the first two frames, and the longest over which a motion is extrapolated [s].
FIRST_INTERVAL_S = 1 / 30
LONGEST_INTERVAL_S = 0.5


@dataclass(frozen=True)
class Settings:
    """TOML keys of the priors.

    Attributes:
        stretch: standard deviation of an edge's relative change of length. Paper: 0.01; rubber: 0.2.
        speed: standard deviation of a parameter's rate of change around the predicted one, expressed as the speed of
            the surface that it moves [m/s].
        memory_s: time constant of the exponential decay of the predicted velocity [s].
    """

    stretch: Annotated[float, Gt(0)] = 0.02
    speed: Annotated[float, Gt(0)] = 0.3
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


class MotionPrior:
    """Motion prior: Θ_t is normal around its extrapolation from the past frames.

    Attributes:
        predicted: predicted parameters (dim,) of the current frame.
        reach_m: radius around the predicted surface within which the surface is searched [m].
    """

    def __init__(self, rest: NDArray[np.float64], scales: NDArray[np.float64], settings: Settings):
        self.predicted = rest
        self.reach_m = np.inf
        self._settings, self._scales = settings, scales
        self._theta = rest
        self._velocity = np.zeros_like(rest)
        self._t_ns: int | None = None
        self._elapsed_s = FIRST_INTERVAL_S
        self._inverse_deviation = self._current_inverse_deviation()

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Standard deviation (dim,) of the parameters around the predicted ones after the longest interval."""
        return self._scales * self._settings.speed * LONGEST_INTERVAL_S

    @property
    def precision(self) -> NDArray[np.float64]:
        """Inverse variance (dim,) of the parameters around the predicted ones."""
        return self._inverse_deviation**2

    def predict(self, t_ns: int) -> None:
        """Predicts theta at time `t_ns` [ns]; the velocity decays with the age of the last estimate."""
        began = self._t_ns is not None
        elapsed_ns = FIRST_INTERVAL_S * 1e9 if self._t_ns is None else max(t_ns - self._t_ns, 1)
        self._elapsed_s = min(elapsed_ns * 1e-9, LONGEST_INTERVAL_S)
        self._t_ns = t_ns
        self._inverse_deviation = self._current_inverse_deviation()
        self.reach_m = FARTHEST * self._settings.speed * self._elapsed_s if began else np.inf
        travel = self._elapsed_s * np.exp(-self._elapsed_s / self._settings.memory_s)
        self.predicted = self._theta + travel * self._velocity

    def restart(self, theta: NDArray[np.float64]) -> None:
        """Restarts at theta (dim,) with zero velocity and the deviation of the longest interval, for relocation."""
        self._theta, self._velocity = theta, np.zeros_like(theta)
        self._t_ns = (self._t_ns or 0) - round(LONGEST_INTERVAL_S * 1e9)

    def update(self, theta: NDArray[np.float64]) -> None:
        """Sets theta and velocity from the estimate of the current frame (dim,)."""
        self._velocity, self._theta = (theta - self._theta) / self._elapsed_s, theta

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        out = np.empty(len(thetas))
        _half_squares_of_each(thetas, self.predicted, self._inverse_deviation, out)
        return out

    def linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """The normalised residuals of parameters (dim,), and their derivatives."""
        return Linearization((theta - self.predicted) * self._inverse_deviation, np.diag(self._inverse_deviation))

    def _current_inverse_deviation(self) -> NDArray[np.float64]:
        """Inverse deviation (dim,) of the parameters around the predicted ones."""
        return 1 / (self._scales * self._settings.speed * self._elapsed_s)


@kernel
def _half_squares(
    thetas: NDArray[np.float64], center: NDArray[np.float64], rows: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """`_half_square` for every candidate of a population."""
    for k in range(thetas.shape[0]):
        out[k] = _half_square(thetas[k], center, rows)


@kernel
def _half_squares_of_each(
    thetas: NDArray[np.float64], center: NDArray[np.float64], scales: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """`_half_square_of_each` for every candidate of a population."""
    for k in range(thetas.shape[0]):
        out[k] = _half_square_of_each(thetas[k], center, scales)


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


@kernel
def _half_square_of_each(theta: NDArray[np.float64], center: NDArray[np.float64], scales: NDArray[np.float64]) -> float:
    """Half the squared length of scales (dim,) times Θ − center."""
    total = 0.0
    for d in range(center.size):
        length = scales[d] * (theta[d] - center[d])
        total += length * length
    return 0.5 * total
