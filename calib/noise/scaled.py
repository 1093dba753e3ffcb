"""A noise model whose deviation is larger or smaller by a factor, as the images themselves show."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, Pixels


@dataclass(frozen=True)
class Scaled:
    """μ of a law, and σ = factor · σ of the law."""

    law: DepthNoise
    factor: float

    @property
    def uses_amplitude(self) -> bool:
        """As the law does."""
        return self.law.uses_amplitude

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset [m]."""
        return self.law.mean(x, a, p)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation [m]."""
        return self.factor * self.law.deviation(x, a, p)
