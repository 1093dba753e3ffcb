"""Noise of a grey pixel around the grey of the vertex that it shows."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS
from calib.noise.fit import pictures


@dataclass(frozen=True)
class GaussianGrey:
    """One deviation for every pixel of a monochrome camera, or of a colour camera whose channels are summed to grey.

    As for colour, it covers what sparse synthesis leaves out more than the camera's own noise.

    Attributes:
        sigma: standard deviation of a pixel, in levels of 256.
    """

    sigma: Annotated[float, Gt(0)] = 15.0

    @property
    def uniform(self) -> float:
        """Negative log-density of a pixel that says nothing about the surface."""
        return float(np.log(LEVELS))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        return np.full_like(values, self.sigma)

    def build(self) -> "GaussianGrey":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianGrey


def fit(measured: ArrayLike, real: ArrayLike) -> GaussianGrey:
    """The model of greatest likelihood.

    Args:
        measured: grey of pixels, in levels of 256; NaN where it does not count.
        real: what they would have measured without noise, in the same shape.

    Raises:
        NoiseError: no measured number comes with a real one.
    """
    return GaussianGrey(pictures.fit_deviation(measured, real))
