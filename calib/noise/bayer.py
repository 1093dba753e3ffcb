"""Noise of a raw pixel behind one colour filter of a Bayer mosaic (section 4.1)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS, NoiseError
from calib.noise.fit import fitting, pictures

#: Every filter lets its own colour through and nothing else.
IDEAL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class GaussianBayer:
    """Every pixel deviates with one deviation from the one channel that its filter lets through.

    What the optics and the filters do to a colour before it is measured is done to the colours of the vertices, never
    undone in the measurement, where it would spread the noise of a pixel over its neighbours.

    Attributes:
        sigma: standard deviation of a pixel, in levels of 256.
        crosstalk: shares of red, green and blue light (columns) in a pixel behind the red, green and blue filter
            (rows): leakage of the filters, and of light into neighbouring pixels.
        defocus_px: how much more this sensor blurs than the one that the vertices' colours come from: deviation of a
            Gaussian in pixels of this sensor. It does nothing to colours that come from this sensor itself, because
            they are as blurred as what they are compared with.
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
        """Negative log-density of a pixel that says nothing about the surface."""
        return float(np.log(LEVELS))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        return np.full_like(values, self.sigma)

    def filtered(self, colors: NDArray[np.floating]) -> NDArray[np.float64]:
        """What the red, green and blue pixels (…, 3) make of colours (…, 3)."""
        return colors.astype(np.float64) @ np.array(self.crosstalk).T

    def unfiltered(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """The colours (…, 3) of which red, green and blue pixels made (…, 3)."""
        return pixels.astype(np.float64) @ np.linalg.inv(np.array(self.crosstalk)).T

    def build(self) -> "GaussianBayer":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianBayer


def fit(measured: ArrayLike, real: ArrayLike) -> GaussianBayer:
    """The deviation of greatest likelihood; see `fit_crosstalk` for the filters.

    Args:
        measured: pixels of mosaics, in levels of 256; NaN where they do not count.
        real: what they would have measured without noise, in the same shape.

    Raises:
        NoiseError: no measured number comes with a real one.
    """
    return GaussianBayer(pictures.fit_deviation(measured, real))


def fit_crosstalk(measured: ArrayLike, colors: ArrayLike, channel: ArrayLike) -> tuple[tuple[float, float, float], ...]:
    """Shares of red, green and blue light behind every filter, from pixels that saw known colours (a colour chart).

    Args:
        measured: pixels (n,) of a mosaic, in levels of 256.
        colors: red, green and blue (n, 3) that each of them looked at, alike in the pixels around it.
        channel: filter (n,) before each pixel: 0 red, 1 green, 2 blue.

    Raises:
        NoiseError: behind a filter there is no pixel, or the colours that it saw do not tell the three shares apart.
    """
    pixels, known, filters = np.asarray(measured, np.float64), np.asarray(colors, np.float64), np.asarray(channel)
    for index, name in enumerate(("red", "green", "blue")):
        if not np.any(filters == index):
            raise NoiseError(f"no pixel lies behind a {name} filter")
    rows = []
    for index in range(3):
        behind = filters == index
        columns = fitting.Columns(known[behind], np.ones((np.count_nonzero(behind), 1)))
        red, green, blue = fitting.maximize(pixels[behind], columns, span=LEVELS).mean.tolist()
        rows.append((red, green, blue))
    return tuple(rows)
