"""Motion prior: Θ is normal around its extrapolation from the past, as wide as the object's motion is unpredictable.

Its deviation v, a rate of change, adapts to the innovations: the differences between estimate and prediction, per
second, as lengths by `ChangeMetric`, whose matrix is B. In a frame of duration t with the covariance Σ of Θ and the
prior's precision W = B / (v t)², the likelihood determines γ = dim − tr(WΣ) parameters (MacKay, Neural Computation 4,
1992, eq. 4.9), and the evidence for v² is the squared length of the innovation divided by γ. Successive innovations are
alike when the object accelerates and the prior holds it back; noise makes them differ. So their product widens the
prior far more.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.innovations import Innovations
from abs_service.tracker.posterior.priors.motion_prediction import MARGIN, MotionPrediction
from abs_service.tracker.posterior.priors.settings import Settings

#: Interval assumed before the first two frames, and the longest over which a motion is extrapolated [s].
FIRST_INTERVAL_S = 1 / 30
MAX_INTERVAL_S = 0.5

#: Width of the prior in root mean squares of what successive innovations have in common.
LAG_MARGIN = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class RecentMotion:
    """The object's recent motion, from the estimates.

    Attributes:
        innovation: root mean square innovation of the last estimate, in deviations v of its motion prior and per
            determined parameter; 0 in the first frame.
        unpredicted: covariance (dim, dim) of the unpredicted motion between two frames, averaged over the last frames.
        unmeasured: covariance (dim, dim) of an unobserved motion between two frames, wider than the mean observed one.
    """

    innovation: float
    unpredicted: NDArray[np.float64]
    unmeasured: NDArray[np.float64]


class MotionPrior:
    """Motion of one object over time, and the prior of each frame that follows from it.

    Args:
        rest: parameters (dim,) that leave the mesh undeformed.
        metric: length of a change of theta.
        settings: bounds of its width.
    """

    def __init__(self, rest: NDArray[np.float64], metric: ChangeMetric, settings: Settings):
        self._settings, self._metric = settings, metric
        self._speed = settings.speed
        self._theta = rest
        self._velocity = np.zeros_like(rest)
        self._t_ns: int | None = None
        self._innovations = Innovations(len(rest))

    @property
    def longest_covariance(self) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the parameters around the predicted ones after the longest interval."""
        return (self._settings.speed * MAX_INTERVAL_S) ** 2 * self._metric.inverse

    def predict(self, t_ns: int) -> MotionPrediction:
        """The prior at time `t_ns` [ns]; the velocity decays with the age of the last estimate."""
        is_first = self._t_ns is None
        elapsed_ns = FIRST_INTERVAL_S * 1e9 if self._t_ns is None else max(t_ns - self._t_ns, 1)
        elapsed_s = min(elapsed_ns * 1e-9, MAX_INTERVAL_S)
        self._t_ns = t_ns
        travel = elapsed_s * self._settings.persistence(elapsed_s)
        theta = self._theta + travel * self._velocity
        return MotionPrediction(theta, self._speed, elapsed_s, is_first, self._metric, self._settings)

    def restart(self, theta: NDArray[np.float64]) -> None:
        """Restarts at theta (dim,) with zero velocity and the deviation of the longest interval, for relocation."""
        self._theta, self._velocity = theta, np.zeros_like(theta)
        self._t_ns = (self._t_ns or 0) - round(MAX_INTERVAL_S * 1e9)
        self._speed, self._innovations = self._settings.speed, Innovations(len(theta))

    def update(
        self, prediction: MotionPrediction, theta: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> RecentMotion:
        """Sets theta, velocity, and the speed for the next frame from the estimate of a frame.

        Args:
            prediction: the prior of the frame.
            theta: the estimate (dim,).
            covariance: Σ (dim, dim), the inverse curvature of the cost.
        """
        elapsed_s, innovation = prediction.elapsed_s, 0.0
        self._velocity, self._theta = (theta - self._theta) / elapsed_s, theta
        if not prediction.is_first:  # in the first, the difference is that from the detected shape
            determined = len(theta) - float(np.vdot(prediction.precision, covariance))
            speed = self._innovations.update(
                prediction.innovation(theta), self._metric.root @ self._velocity, determined, elapsed_s
            )
            innovation = speed / prediction.speed
            lag = np.sqrt(self._innovations.lasting)
            self._speed = self._settings.limited(max(MARGIN * speed, LAG_MARGIN * lag))
        return RecentMotion(
            innovation,
            unpredicted=elapsed_s**2 * self._innovations.motion_variance * self._metric.inverse,
            unmeasured=(MARGIN * elapsed_s) ** 2 * self._innovations.squared_speed * self._metric.inverse,
        )
