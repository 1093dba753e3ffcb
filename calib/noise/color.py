"""Noise of a colour pixel around the colour of the vertex that it shows."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS
from calib.noise.fit import pictures


@dataclass(frozen=True)
class GaussianColor:
    """Every channel deviates independently, with one deviation.

    It covers the camera's noise and, much larger, what sparse synthesis leaves out: interpolation between pixels and
    changes of illumination. That is why it is a number of the rig and not of the data sheet.

    Attributes:
        sigma: standard deviation of a channel, in levels of 256.
    """

    sigma: Annotated[float, Gt(0)] = 15.0

    @property
    def uniform(self) -> float:
        """Negative log-density of a colour that says nothing about the surface."""
        return float(3 * np.log(LEVELS))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured channels, in their shape."""
        return np.full_like(values, self.sigma)

    def build(self) -> "GaussianColor":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianColor


def fit(measured: ArrayLike, real: ArrayLike) -> GaussianColor:
    """The model of greatest likelihood.

    Args:
        measured: colours (…, 3), in levels of 256; NaN where they do not count.
        real: what they would have been without noise, in the same shape.

    Raises:
        NoiseError: no measured number comes with a real one.
    """
    return GaussianColor(pictures.fit_deviation(measured, real))
