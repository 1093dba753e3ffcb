"""Running statistics of a motion and its innovations, per parameter that the measurements determine."""

import numpy as np
from numpy.typing import NDArray

#: Time constant of the running means [s].
MEMORY_S = 0.5

#: Noise of the estimates has a part in their innovations, since predictions extrapolate it: with a share a of the last
#: velocity, it is e_t − (1 + a) e_{t−1} + a e_{t−2}, with the variance (1 + (1 + a)² + a²) σ² and the covariance
#: −(1 + a)² σ² with the next one. This is the ratio of the two for a = 0.7, at 30 Hz.
NOISE_RATIO = 1.5


class Innovations:
    """Running means over the last frames; parameters that no measurement determines neither raise nor lower them.

    Attributes:
        variance: mean squared innovation [m²/s²].
        repeated: mean product of two successive innovations [m²/s²].
        lasting: largest recent product of two successive innovations, at least 0 [m²/s²].
        squared_speed: mean squared speed [m²/s²].
    """

    def __init__(self, dimension: int):
        self.variance = self.repeated = self.lasting = self.squared_speed = 0.0
        self._dimension = dimension
        self._last = np.zeros(dimension)
        self._age_s = 0.0

    @property
    def motion_variance(self) -> float:
        """Mean squared innovation without the part of the estimates' noise [m²/s²]."""
        return min(max(self.variance + NOISE_RATIO * self.repeated, 0.0), self.variance)

    def update(
        self, innovation: NDArray[np.float64], velocity: NDArray[np.float64], determined: float, elapsed_s: float
    ) -> float:
        """Root mean square innovation of this frame [m/s].

        Args:
            innovation: difference of estimate and prediction (dim,) as a speed [m/s].
            velocity: change of the estimates (dim,) [m/s].
            determined: number γ of parameters that the measurements determine.
            elapsed_s: time since the frame before [s].
        """
        self._age_s += elapsed_s
        counted = max(determined, 1.0)
        weight = max(-np.expm1(-elapsed_s / MEMORY_S), elapsed_s / self._age_s) * max(determined, 0.0) / self._dimension
        square, repeated = float(innovation @ innovation) / counted, float(innovation @ self._last) / counted
        self.variance += weight * (square - self.variance)
        self.repeated += weight * (repeated - self.repeated)
        self.lasting = max(self.lasting + weight * (repeated - self.lasting), repeated, 0.0)
        self.squared_speed += weight * (float(velocity @ velocity) / counted - self.squared_speed)
        self._last = innovation
        return float(np.sqrt(square))
