"""Constant deviation and mean offset, independent of the distance: the default before any calibration."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from calib.noise.base import Pixels
from calib.noise.fit import fitting
from calib.noise.fit.samples import Samples


@dataclass(frozen=True)
class Constant:
    """μ = offset and σ = sigma.

    Attributes:
        sigma: standard deviation of a distance [m].
        offset: mean offset of a distance [m].
    """

    sigma: Annotated[float, Interval(gt=0, le=0.5)]  # millimetres are refused: no depth camera is that bad
    offset: float = 0.0

    @property
    def uses_amplitude(self) -> bool:
        """Always false."""
        return False

    def build(self) -> "Constant":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset [m]."""
        return np.full(np.shape(x), self.offset)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation [m]."""
        return np.full(np.shape(x), self.sigma)


Settings = Constant


def fit(samples: Samples) -> Constant:
    """Maximum-likelihood constants.

    Raises:
        NoiseError: no sample has a distance.
    """
    samples = fitting.subsampled(samples.returns(with_amplitude=False))
    one = np.ones((len(samples), 1))
    law = fitting.maximize_likelihood(samples.residual, fitting.Design(one, one), minimum=samples.minimum_sigma)
    return Constant(fitting.minimum_sigma(np.maximum(law.spread, samples.minimum_sigma)), float(law.mean[0]))
