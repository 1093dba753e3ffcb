"""Motion prior: Θ is normal around its extrapolation from the past, as wide as the object's motion is unpredictable.

Its deviation v, a rate of change, adapts to the innovations: the differences between estimate and prediction, per
second and in the unit of the parameters' scales. In a frame with the covariance Σ of Θ and the prior's precision W, the
likelihood determines γ = Σᵢ (1 − WᵢᵢΣᵢᵢ) parameters (MacKay, Neural Computation 4, 1992, eq. 4.9), and the evidence for
v² is the sum of the squared innovations divided by γ. Successive innovations are alike when the object accelerates and
the prior holds it back; noise makes them differ. So their product widens the prior far more.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.priors.innovations import Innovations
from abs_service.tracker.posterior.priors.settings import Settings
from abs_service.tracker.terms.linearization import Linearization
from calib.jit import kernel

#: Radius of the search around the prediction, in standard deviations of the widest motion prior.
FARTHEST = 4.0

#: Interval assumed before the first two frames, and the longest over which a motion is extrapolated [s].
FIRST_INTERVAL_S = 1 / 30
LONGEST_INTERVAL_S = 0.5

#: Width of the prior in root mean squares of the last innovations, and in those of what successive ones have in common.
MARGIN, LAG_MARGIN = 2.0, 10.0


class MotionPrior:
    """Motion prior: Θ_t is normal around its extrapolation from the past frames.

    Attributes:
        predicted: predicted parameters (dim,) of the current frame.
        reach_m: radius around the predicted surface within which the surface is searched [m].
        speed: standard deviation of the parameters' rates of change around the predicted ones [m/s].
    """

    def __init__(self, rest: NDArray[np.float64], scales: NDArray[np.float64], settings: Settings):
        self.predicted = rest
        self.reach_m = np.inf
        self.speed = self._next_speed = settings.speed
        self._settings, self._scales = settings, scales
        self._theta = rest
        self._velocity = np.zeros_like(rest)
        self._t_ns: int | None = None
        self._began = False
        self._elapsed_s = FIRST_INTERVAL_S
        self._innovations = Innovations(len(rest))

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Standard deviation (dim,) of the parameters around the predicted ones after the longest interval."""
        return self._scales * self._settings.speed * LONGEST_INTERVAL_S

    @property
    def precision(self) -> NDArray[np.float64]:
        """Inverse variance (dim,) of the parameters around the predicted ones."""
        return self._inverse_deviation**2

    @property
    def least_precision(self) -> NDArray[np.float64]:
        """Inverse variance (dim,) of the widest prior, that of an object whose motion is unknown."""
        return 1 / (self._scales * self._settings.speed * self._elapsed_s) ** 2

    @property
    def unpredicted(self) -> NDArray[np.float64]:
        """Standard deviation (dim,) of the motion between two frames that was not predicted, lately."""
        return self._scales * self._elapsed_s * np.sqrt(self._innovations.variance)

    @property
    def unseen(self) -> NDArray[np.float64]:
        """Standard deviation (dim,) of a motion between two frames that nothing shows: wider than those seen lately."""
        return MARGIN * self._scales * self._elapsed_s * np.sqrt(self._innovations.squared_speed)

    @property
    def _inverse_deviation(self) -> NDArray[np.float64]:
        return 1 / (self._scales * self.speed * self._elapsed_s)

    def predict(self, t_ns: int) -> None:
        """Predicts theta at time `t_ns` [ns]; the velocity decays with the age of the last estimate."""
        self._began = self._t_ns is not None
        elapsed_ns = FIRST_INTERVAL_S * 1e9 if self._t_ns is None else max(t_ns - self._t_ns, 1)
        self._elapsed_s = min(elapsed_ns * 1e-9, LONGEST_INTERVAL_S)
        self._t_ns = t_ns
        self.speed = self._next_speed
        self.reach_m = FARTHEST * self._settings.speed * self._elapsed_s if self._began else np.inf
        travel = self._elapsed_s * np.exp(-self._elapsed_s / self._settings.memory_s)
        self.predicted = self._theta + travel * self._velocity

    def restart(self, theta: NDArray[np.float64]) -> None:
        """Restarts at theta (dim,) with zero velocity and the deviation of the longest interval, for relocation."""
        self._theta, self._velocity = theta, np.zeros_like(theta)
        self._t_ns = (self._t_ns or 0) - round(LONGEST_INTERVAL_S * 1e9)
        self._next_speed, self._innovations = self._settings.speed, Innovations(len(theta))

    def widen(self, theta: NDArray[np.float64]) -> bool:
        """Widens the prior of the current frame if theta (dim,) is beyond it, after a sudden motion; True if so."""
        speed = float(np.sqrt(np.mean(self._innovation(theta) ** 2)))
        if not self._began or speed <= self.speed or self.speed >= self._settings.speed:
            return False
        self.speed = self._limited(MARGIN * speed)
        return True

    def update(self, theta: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Sets theta and velocity from the estimate of the current frame, and the speed for the next one.

        Args:
            theta: the estimate (dim,).
            covariance: Σ (dim, dim), the inverse curvature of the cost.
        """
        self._velocity, self._theta = (theta - self._theta) / self._elapsed_s, theta
        if self._began:  # before, the difference is that from the detected shape
            determined = float(np.sum(1 - self.precision * np.diag(covariance)))
            speed = self._innovations.update(
                self._innovation(theta), self._velocity / self._scales, determined, self._elapsed_s
            )
            self._next_speed = self._limited(max(MARGIN * speed, LAG_MARGIN * np.sqrt(self._innovations.lasting)))

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        out = np.empty(len(thetas))
        _half_squares_of_each(thetas, self.predicted, self._inverse_deviation, out)
        return out

    def linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """The normalised residuals of parameters (dim,), and their derivatives."""
        return Linearization((theta - self.predicted) * self._inverse_deviation, np.diag(self._inverse_deviation))

    def _innovation(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Innovation (dim,) as a rate of change of the surface [m/s]."""
        return (theta - self.predicted) / (self._scales * self._elapsed_s)

    def _limited(self, speed: float) -> float:
        return float(np.clip(speed, self._settings.least_speed, self._settings.speed))


@kernel
def _half_squares_of_each(
    thetas: NDArray[np.float64], center: NDArray[np.float64], scales: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Half the squared length of scales (dim,) times Θ − center, for every candidate."""
    for k in range(thetas.shape[0]):
        total = 0.0
        for d in range(center.size):
            length = scales[d] * (thetas[k, d] - center[d])
            total += length * length
        out[k] = 0.5 * total
