"""Noise of a colour pixel around the colour of the vertex that it shows."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS
from calib.noise.fit import image_noise


@dataclass(frozen=True)
class GaussianColor:
    """Gaussian noise of equal deviation, independent in every channel.

    Covers camera noise and, much larger, errors of sparse synthesis: interpolation between pixels and changes of
        illumination. Therefore it is a property of the rig and not of the data sheet.

    Attributes:
        sigma: standard deviation of a channel, in levels of 256.
    """

    sigma: Annotated[float, Gt(0)] = 15.0

    @property
    def uniform(self) -> float:
        """Negative log-density of an outlier: uniform over all colours."""
        return float(3 * np.log(LEVELS))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured channels, in their shape."""
        return np.full_like(values, self.sigma)

    def build(self) -> "GaussianColor":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianColor


def fit(measured: ArrayLike, real: ArrayLike) -> GaussianColor:
    """Maximum-likelihood model.

    Args:
        measured: colours (…, 3), in levels of 256; NaN is ignored.
        real: noise-free colours, in the same shape.

    Raises:
        NoiseError: no measured value has a finite true value.
    """
    return GaussianColor(image_noise.fit_deviation(measured, real))
