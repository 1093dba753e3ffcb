"""Compares the residuals of each sensor with its noise model, once a second."""

from dataclasses import dataclass

import numpy as np

from abs_service.bus.health import Health, Level
from abs_service.tracker.estimates.estimate import Estimate

#: Time over which residuals are averaged [ns]; at 30 Hz and 300 vertices, their variance is then known to 2 %.
WINDOW_NS = 1_000_000_000

#: With fewer inliers the residuals are not due to noise: the object is lost, occluded, or deforms beyond its model.
MIN_INLIER_SHARE = 0.6

#: A window with fewer residuals is ignored.
MIN_RESIDUALS = 200

#: The variance of residuals over deviations is 1 if the noise model is right. A warning begins outside the wider limits
#: and ends within the narrower ones, a hysteresis.
WARN_OUTSIDE = (0.5, 2.0)
CLEAR_INSIDE = (0.6, 1.7)


@dataclass(slots=True)
class _Sum:
    """Residuals of one sensor in one window."""

    number: int = 0
    squares: float = 0.0


class NoiseMonitor:
    """Sets the gauge `residual_variance.<sensor>` and a warning if a sensor's noise model is wrong.

    A deviation that is too small rejects good measurements; one that is too large gives the sensor too little weight
    beside the others, and makes the covariance of Θ depend on what the priors allow.
    """

    def __init__(self, health: Health):
        self._health = health
        self._begin_ns = 0
        self._sums: dict[str, _Sum] = {}
        self._warned: set[str] = set()

    def add(self, estimate: Estimate) -> None:
        """Adds an estimate's residuals, if its inlier share is sufficient."""
        if estimate.inlier_share < MIN_INLIER_SHARE:
            return
        if not 0 <= estimate.t_host_ns - self._begin_ns < WINDOW_NS:
            for sensor, total in self._sums.items():
                if total.number >= MIN_RESIDUALS:
                    self._check(sensor, total.squares / total.number)
            self._begin_ns = estimate.t_host_ns
            self._sums = {}
        for fit in estimate.fits:
            if np.isfinite(fit.normalized_residual):
                total = self._sums.setdefault(fit.sensor, _Sum())
                total.number += fit.inliers
                total.squares += fit.inliers * fit.normalized_residual**2

    def _check(self, sensor: str, variance: float) -> None:
        self._health.gauge(f"residual_variance.{sensor}", variance)
        low, high = CLEAR_INSIDE if sensor in self._warned else WARN_OUTSIDE
        wrong = not low <= variance <= high
        (self._warned.add if wrong else self._warned.discard)(sensor)
        level = Level.WARNING if wrong else Level.OK
        self._health.report(f"noise of {sensor}", level, _advice(sensor, variance) if wrong else "")


def _advice(sensor: str, variance: float) -> str:
    head, texture, _ = sensor.partition("/")
    key = f"sensors.{head}.texture" if texture else f"sensors.{head}.noise"
    factor, change = np.sqrt(variance), "larger" if variance > 1 else "smaller"
    return (
        f"{sensor} errs {factor:.1f} times as much as its noise model says (variance of its residuals {variance:.1f} "
        f"instead of 1): make the deviation in {key} {change}, or fit it (docs/explanation/noise.md)"
    )
