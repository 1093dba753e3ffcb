"""Noise of a grey pixel around the grey value of its vertex."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS
from calib.noise.fit import image_noise


@dataclass(frozen=True)
class GaussianGrey:
    """Gaussian noise of a monochrome camera, or of a colour camera whose channels are averaged.

    As for colour, errors of sparse synthesis dominate the camera's own noise.

    Attributes:
        sigma: standard deviation of a pixel, in levels of 256.
    """

    sigma: Annotated[float, Gt(0)] = 15.0

    @property
    def uniform(self) -> float:
        """Negative log-density of an outlier: uniform over all values."""
        return float(np.log(LEVELS))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        return np.full_like(values, self.sigma)

    def build(self) -> "GaussianGrey":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianGrey


def fit(measured: ArrayLike, real: ArrayLike) -> GaussianGrey:
    """Maximum-likelihood model.

    Args:
        measured: grey values, in levels of 256; NaN is ignored.
        real: noise-free values, in the same shape.

    Raises:
        NoiseError: no measured value has a finite true value.
    """
    return GaussianGrey(image_noise.fit_deviation(measured, real))
