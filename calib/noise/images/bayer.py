"""Noise of a raw pixel behind one colour filter of a Bayer mosaic (section 4.1)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS, NoiseError
from calib.noise.fit import fitting, image_noise

#: Ideal filters without crosstalk.
IDEAL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class GaussianBayer:
    """Gaussian noise of every pixel around the one channel that its filter passes.

    Optical blur and filter crosstalk are applied to the colours of the vertices and never inverted in the measurement,
    where inversion would spread the noise of a pixel over its neighbours.

    Attributes:
        sigma: standard deviation of a pixel, in levels of 256.
        crosstalk: contributions of red, green and blue light (columns) to a pixel behind the red, green and blue filter
            (rows): leakage of the filters, and of light into neighbouring pixels.
        defocus_px: additional blur of this sensor relative to the one that the vertices' colours come from: standard
            deviation of a Gaussian in pixels of this sensor. No effect on colours that come from this sensor itself,
            because they have the same blur as the measurement.
    """

    sigma: Annotated[float, Gt(0)] = 15.0
    crosstalk: tuple[tuple[float, float, float], ...] = IDEAL
    defocus_px: Annotated[float, Ge(0)] = 0.0

    def __post_init__(self) -> None:
        if len(self.crosstalk) != 3 or abs(np.linalg.det(np.array(self.crosstalk))) < 1e-3:
            raise NoiseError(
                "crosstalk must be three rows of three numbers, of which none follows from the others, "
                f"not {[list(row) for row in self.crosstalk]}"
            )

    @property
    def uniform(self) -> float:
        """Negative log-density of an outlier: uniform over all values."""
        return float(np.log(LEVELS))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        return np.full_like(values, self.sigma)

    def apply_crosstalk(self, colors: NDArray[np.floating]) -> NDArray[np.float64]:
        """Values of red, green and blue pixels (…, 3) for colours (…, 3): crosstalk applied."""
        return colors.astype(np.float64) @ np.array(self.crosstalk).T

    def remove_crosstalk(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Colours (…, 3) for values of red, green and blue pixels (…, 3): crosstalk inverted."""
        return pixels.astype(np.float64) @ np.linalg.inv(np.array(self.crosstalk)).T

    def build(self) -> "GaussianBayer":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianBayer


def fit(measured: ArrayLike, real: ArrayLike) -> GaussianBayer:
    """Maximum-likelihood deviation; see `fit_crosstalk` for the filters.

    Args:
        measured: mosaic pixels, in levels of 256; NaN is ignored.
        real: noise-free values, in the same shape.

    Raises:
        NoiseError: no measured value has a finite true value.
    """
    return GaussianBayer(image_noise.fit_deviation(measured, real))


def fit_crosstalk(measured: ArrayLike, colors: ArrayLike, channel: ArrayLike) -> tuple[tuple[float, float, float], ...]:
    """Contributions of red, green and blue light behind every filter, from pixels that measured known colours.

    Args:
        measured: pixels (n,) of a mosaic, in levels of 256.
        colors: true red, green and blue (n, 3) at each pixel, uniform in its neighbourhood (a colour chart).
        channel: filter (n,) of each pixel: 0 red, 1 green, 2 blue.

    Raises:
        NoiseError: no pixel behind one of the filters, or its colours do not determine the three contributions.
    """
    pixels, known, filters = np.asarray(measured, np.float64), np.asarray(colors, np.float64), np.asarray(channel)
    for index, name in enumerate(("red", "green", "blue")):
        if not np.any(filters == index):
            raise NoiseError(f"no pixel lies behind a {name} filter")
    rows = []
    for index in range(3):
        behind = filters == index
        columns = fitting.Design(known[behind], np.ones((np.count_nonzero(behind), 1)))
        red, green, blue = fitting.maximize_likelihood(pixels[behind], columns, span=LEVELS).mean.tolist()
        rows.append((red, green, blue))
    return tuple(rows)
