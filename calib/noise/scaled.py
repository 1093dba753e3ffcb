"""A noise model whose deviation is larger or smaller by a factor, as the images themselves show."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, Pixels


@dataclass(frozen=True)
class Scaled:
    """μ of a noise model, and σ = factor · its σ."""

    model: DepthNoise
    factor: float

    @property
    def uses_amplitude(self) -> bool:
        """True if that model uses it."""
        return self.model.uses_amplitude

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset [m]."""
        return self.model.mean(x, a, p)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation [m]."""
        return self.factor * self.model.deviation(x, a, p)
