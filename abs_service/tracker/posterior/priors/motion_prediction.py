"""Motion prior of one frame: Θ is normal around its prediction."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.settings import Settings

#: Radius of the search around the prediction, in standard deviations of the widest motion prior.
MAX_DEVIATIONS = 4.0

#: Width of the prior in root mean squares of the innovations.
MARGIN = 2.0


@dataclass(frozen=True, eq=False)
class MotionPrediction:
    """Motion prior of one frame.

    Attributes:
        theta: predicted parameters (dim,).
        speed: standard deviation v of the rate of change around the predicted one, per direction of Θ [m/s].
        elapsed_s: time since the frame before [s].
        is_first: True for the first frame, whose prediction is the detected shape.
        metric: length of a change of theta.
        settings: bounds of the width.
    """

    theta: NDArray[np.float64]
    speed: float
    elapsed_s: float
    is_first: bool
    metric: ChangeMetric
    settings: Settings

    @property
    def reach_m(self) -> float:
        """Radius around the predicted surface within which the surface is searched [m]."""
        return np.inf if self.is_first else MAX_DEVIATIONS * self._widest_m

    @cached_property
    def precision(self) -> NDArray[np.float64]:
        """Inverse covariance W (dim, dim) of the parameters around the predicted ones."""
        return self.metric.matrix / self._deviation_m**2

    @property
    def minimum_precision(self) -> NDArray[np.float64]:
        """Inverse covariance (dim, dim) of the widest prior, that of an object whose motion is unknown."""
        return self.metric.matrix / self._widest_m**2

    def exchanged(self, share: float) -> NDArray[np.float64]:
        """A share of the widest prior's precision in place of this one's: their difference (dim, dim)."""
        return self.metric.matrix * (share / self._widest_m**2 - 1 / self._deviation_m**2)

    @property
    def persistence(self) -> float:
        """Share of the last velocity that is predicted for this frame, 0…1."""
        return self.settings.persistence(self.elapsed_s)

    @property
    def wandered_m2(self) -> float:
        """Mean square of the way along one direction since the frame before, of a motion that nothing shows [m²].

        A velocity as large as the prior allows for lasts for its memory, so the ways of many frames add up to that.
        """
        return 2 * self.settings.memory_s * self.settings.speed**2 * self.elapsed_s

    def unseen_precision(self, time_s: float) -> NDArray[np.float64]:
        """Inverse covariance (dim, dim) of an object that has moved unseen for a time [s], see `wandered_m2`."""
        return self.metric.matrix * (self.elapsed_s / (time_s * self.wandered_m2))

    @property
    def _deviation_m(self) -> float:
        return self.speed * self.elapsed_s

    @property
    def _widest_m(self) -> float:
        return self.settings.speed * self.elapsed_s

    def innovation(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Difference (dim,) of theta (dim,) and the prediction, as a rate of change of the surface [m/s]."""
        return self.metric.root @ (theta - self.theta) / self.elapsed_s

    def is_too_narrow(self, theta: NDArray[np.float64]) -> bool:
        """True if theta (dim,) is beyond the prior and a wider one is allowed, as after a sudden motion."""
        return not self.is_first and self.speed < self.settings.speed and self._mean_innovation(theta) > self.speed

    def widened(self, theta: NDArray[np.float64]) -> "MotionPrediction":
        """The prior that allows for theta (dim,), within the bounds of the settings."""
        return replace(self, speed=self.settings.limited(MARGIN * self._mean_innovation(theta)))

    def around(self, theta: NDArray[np.float64]) -> "MotionPrediction":
        """The widest prior, around theta (dim,) instead: that of an object which nothing was seen of meanwhile."""
        return replace(self, theta=theta, speed=self.settings.speed)

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        return self.metric.squares(thetas, self.theta) / (2 * self._deviation_m**2)

    def _mean_innovation(self, theta: NDArray[np.float64]) -> float:
        """Root mean square innovation of theta (dim,) [m/s]."""
        innovation = self.innovation(theta)
        return float(np.sqrt(innovation @ innovation / len(innovation)))
