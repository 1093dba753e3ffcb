"""Motion prior: Θ is normal around its extrapolation from the past, as wide as the object's motion is unpredictable.

Its deviation v, a rate of change, adapts to the innovations: the differences between estimate and prediction, per
second, as lengths by `ChangeMetric`, whose matrix is B. In a frame of duration t with the covariance Σ of Θ and the
prior's precision W = B / (v t)², the likelihood determines γ = dim − tr(WΣ) parameters (MacKay, Neural Computation 4,
1992, eq. 4.9), and the evidence for v² is the squared length of the innovation divided by γ. Successive innovations are
alike when the object accelerates and the prior holds it back; noise makes them differ. So their product widens the
prior far more.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.innovations import Innovations
from abs_service.tracker.posterior.priors.settings import Settings
from abs_service.tracker.terms.linearization import Linearization

#: Radius of the search around the prediction, in standard deviations of the widest motion prior.
FARTHEST = 4.0

#: Interval assumed before the first two frames, and the longest over which a motion is extrapolated [s].
FIRST_INTERVAL_S = 1 / 30
LONGEST_INTERVAL_S = 0.5

#: Width of the prior in root mean squares of the last innovations, and in those of what successive ones have in common.
MARGIN, LAG_MARGIN = 2.0, 10.0


class MotionPrior:
    """Motion prior: Θ_t is normal around its extrapolation from the past frames.

    Args:
        rest: parameters (dim,) that leave the mesh undeformed.
        metric: length of a change of theta.
        settings: bounds of its width.

    Attributes:
        predicted: predicted parameters (dim,) of the current frame.
        reach_m: radius around the predicted surface within which the surface is searched [m].
        speed: standard deviation v of the rate of change around the predicted one, per direction of Θ [m/s].
        surprise: root mean square innovation of the last estimate, in v and per determined parameter; 0 in the first
            frame.
    """

    def __init__(self, rest: NDArray[np.float64], metric: ChangeMetric, settings: Settings):
        self.predicted = rest
        self.reach_m = np.inf
        self.speed = self._next_speed = settings.speed
        self.surprise = 0.0
        self._settings, self._metric = settings, metric
        self._theta = rest
        self._velocity = np.zeros_like(rest)
        self._t_ns: int | None = None
        self._began = False
        self._elapsed_s = FIRST_INTERVAL_S
        self._innovations = Innovations(len(rest))

    @property
    def longest_covariance(self) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the parameters around the predicted ones after the longest interval."""
        return (self._settings.speed * LONGEST_INTERVAL_S) ** 2 * self._metric.inverse

    @property
    def precision(self) -> NDArray[np.float64]:
        """Inverse covariance W (dim, dim) of the parameters around the predicted ones."""
        return self._metric.matrix / self._deviation_m**2

    @property
    def least_precision(self) -> NDArray[np.float64]:
        """Inverse covariance (dim, dim) of the widest prior, that of an object whose motion is unknown."""
        return self._metric.matrix / (self._settings.speed * self._elapsed_s) ** 2

    @property
    def unpredicted(self) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the unpredicted motion between two frames, averaged over the last frames."""
        return self._elapsed_s**2 * self._innovations.motion_variance * self._metric.inverse

    @property
    def unseen(self) -> NDArray[np.float64]:
        """Covariance (dim, dim) of an unobserved motion between two frames, wider than the mean observed one."""
        return (MARGIN * self._elapsed_s) ** 2 * self._innovations.squared_speed * self._metric.inverse

    @property
    def persistence(self) -> float:
        """Share of the last velocity that is predicted for the current frame, 0…1."""
        return float(np.exp(-self._elapsed_s / self._settings.memory_s))

    @property
    def _deviation_m(self) -> float:
        return self.speed * self._elapsed_s

    def predict(self, t_ns: int) -> None:
        """Predicts theta at time `t_ns` [ns]; the velocity decays with the age of the last estimate."""
        self._began = self._t_ns is not None
        elapsed_ns = FIRST_INTERVAL_S * 1e9 if self._t_ns is None else max(t_ns - self._t_ns, 1)
        self._elapsed_s = min(elapsed_ns * 1e-9, LONGEST_INTERVAL_S)
        self._t_ns = t_ns
        self.speed = self._next_speed
        self.reach_m = FARTHEST * self._settings.speed * self._elapsed_s if self._began else np.inf
        travel = self._elapsed_s * self.persistence
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
            determined = len(theta) - float(np.vdot(self.precision, covariance))
            speed = self._innovations.update(
                self._innovation(theta), self._metric.root @ self._velocity, determined, self._elapsed_s
            )
            self.surprise = speed / self.speed
            self._next_speed = self._limited(max(MARGIN * speed, LAG_MARGIN * np.sqrt(self._innovations.lasting)))

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        return self._metric.squares(thetas, self.predicted) / (2 * self._deviation_m**2)

    def linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """The normalised residuals of parameters (dim,), and their derivatives."""
        rows = self._metric.root / self._deviation_m
        return Linearization(rows @ (theta - self.predicted), rows)

    def _innovation(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Innovation (dim,) as a rate of change of the surface [m/s]."""
        return self._metric.root @ (theta - self.predicted) / self._elapsed_s

    def _limited(self, speed: float) -> float:
        return float(np.clip(speed, self._settings.least_speed, self._settings.speed))
