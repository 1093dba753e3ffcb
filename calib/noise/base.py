"""Interface of noise models: density of what they describe (eqs. 17–19)."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

LOG_SQRT_2PI = 0.5 * np.log(2 * np.pi)

#: Number of values of a colour channel.
LEVELS = 256.0

#: Rows and columns of measuring pixels, each (n,).
Pixels = tuple[NDArray[np.integer], NDArray[np.integer]]


class NoiseError(ValueError):
    """Parameters that describe no noise model; names the key and the allowed values."""


def pixels_where(mask: NDArray[np.bool_]) -> Pixels:
    """Rows and columns of the pixels at which an image (height, width) is true."""
    rows, columns = np.nonzero(mask)
    return rows, columns


@runtime_checkable
class DepthNoise(Protocol):
    """Gaussian noise of the distance measured by pixel p, given the true distance x [m] and the measured amplitude a.

    If the sensor reports its own σ per measurement, a is that σ [m]. Arrays x are (n,), one distance for each of n
    pixels, or (…, n), several; a is (n,).
    """

    @property
    def uses_amplitude(self) -> bool:
        """True if μ or σ depends on the amplitude, so that frames without amplitudes cannot be used."""
        ...

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) of a measurement from the true distance [m], in the shape of x."""
        ...

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) of a measurement [m], always positive, in the shape of x."""
        ...


@runtime_checkable
class Mapped(Protocol):
    """A noise model with numbers of its own for every pixel, so that it is for images of one size only."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the images."""
        ...


@runtime_checkable
class ImageNoise(Protocol):
    """Gaussian noise of a pixel's colour, grey value or intensity, in the sensor's unit."""

    @property
    def uniform(self) -> float:
        """Negative log-density of an outlier [nats]."""
        ...

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        ...


def log_density(model: DepthNoise, measured: ArrayLike, x: ArrayLike, a: ArrayLike, p: Pixels) -> NDArray[np.float64]:
    """Logarithm of eq. 18: density of measuring `measured` [m] at pixel p when the true distance is `x` [m]."""
    x, a = np.asarray(x, np.float64), np.asarray(a, np.float64)
    deviation = model.deviation(x, a, p)
    normalized = (np.asarray(measured) - x - model.mean(x, a, p)) / deviation
    return -0.5 * normalized**2 - np.log(deviation) - LOG_SQRT_2PI


def subtract_mean_offset(
    model: DepthNoise, distance: NDArray[np.floating], amplitude: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Depth image (height, width) [m] minus the mean offset, evaluated at the measured distance."""
    x, a = distance.astype(np.float64).ravel(), amplitude.astype(np.float64).ravel()
    rows, columns = np.indices(distance.shape)
    return (x - model.mean(x, a, (rows.ravel(), columns.ravel()))).reshape(distance.shape).astype(np.float32)
