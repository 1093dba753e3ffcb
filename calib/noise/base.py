"""Interface of noise models, and the texture into which every depth noise model is rendered (eqs. 17–19)."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.jit import kernel

#: Half width of the interval of measured − mean offset − synthesised distance that a texel describes [m]; outside, the
#: edge value applies.
WINDOW_M = 0.05

#: Smallest distance of a surface [m]; keeps the near end of the interval in front of the camera.
MIN_DISTANCE_M = 1e-3

#: Pixels rendered in one call: few enough that intermediate results stay in the cache, many enough to amortise the
#: call.
_BLOCK = 32768

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


def sample(
    model: DepthNoise, generator: np.random.Generator, x: ArrayLike, a: ArrayLike, p: Pixels
) -> NDArray[np.float64]:
    """Random measurement [m] for every true distance `x` [m] and amplitude `a` at the pixels `p`."""
    x, a = np.asarray(x, np.float64), np.asarray(a, np.float64)
    return x + model.mean(x, a, p) + model.deviation(x, a, p) * generator.standard_normal(x.shape)


def subtract_mean_offset(
    model: DepthNoise, distance: NDArray[np.floating], amplitude: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Depth image (height, width) [m] minus the mean offset, evaluated at the measured distance."""
    x, a = distance.astype(np.float64).ravel(), amplitude.astype(np.float64).ravel()
    rows, columns = np.indices(distance.shape)
    return (x - model.mean(x, a, (rows.ravel(), columns.ravel()))).reshape(distance.shape).astype(np.float32)


def write_texture(
    model: DepthNoise,
    distance: NDArray[np.float32],
    amplitude: NDArray[np.float32],
    corner: tuple[int, int],
    texture: NDArray[np.float32],
) -> None:
    """Renders eq. 18 for a part of an image into the coefficients that the likelihood kernel reads.

    Every noise model becomes the same texture, so all have the same cost per vertex. With y the measurement minus the
    mean offset evaluated at y itself, and t = y − x, a texel holds [y, m0, m1, s0, s1, s2, n0, n1]: remaining mean
    offset m0 + m1 t, inverse deviation s0 + s1 t + s2 t², and negative logarithm of the normaliser n0 + n1 t. Pixels
    without a return keep their previous content.

    Args:
        model: the noise model.
        distance: measured radial distances (rows, columns) [m], NaN without return.
        amplitude: measured amplitudes (rows, columns); ignored if the model does not use them.
        corner: row and column of the part's first pixel in the image.
        texture: of the whole image, with a border of one pixel (height + 2, width + 2, 8).
    """
    rows = max(1, _BLOCK // max(distance.shape[1], 1))
    for top in range(0, len(distance), rows):
        block = slice(top, top + rows)
        _render_rows(model, distance[block], amplitude[block], (corner[0] + top, corner[1]), texture)


def _render_rows(
    model: DepthNoise,
    distance: NDArray[np.float32],
    amplitude: NDArray[np.float32],
    corner: tuple[int, int],
    texture: NDArray[np.float32],
) -> None:
    """Writes the texels of a block small enough for the cache."""
    pixels, returns = np.empty((2, distance.size), np.int64), np.empty((2, distance.size))
    n = _returns(
        np.ascontiguousarray(distance, np.float32),
        np.ascontiguousarray(amplitude, np.float32),
        *corner,
        model.uses_amplitude,
        pixels,
        returns,
    )
    p, (measured, a) = (pixels[0, :n], pixels[1, :n]), returns[:, :n]
    offset = model.mean(measured, a, p)  # may exceed the interval, which is centred on the surface
    center = measured - offset
    nodes = np.maximum(center + np.array([[WINDOW_M], [0.0], [-WINDOW_M]]), MIN_DISTANCE_M)
    deviation = model.deviation(nodes, a, p)
    # NumPy takes logarithms of many numbers at once, the compiler does not.
    with np.errstate(over="ignore"):  # farther than 1 km, single precision has no room for every model's deviation
        normalizer = np.log(deviation[1].astype(np.float32)) + np.float32(LOG_SQRT_2PI)
        growth = np.log((deviation[2] / deviation[0]).astype(np.float32))
    _write_texels(*p, center, model.mean(nodes, a, p) - offset, deviation, normalizer, growth, texture)


@kernel
def _returns(
    distance: NDArray[np.float32],
    amplitude: NDArray[np.float32],
    top: int,
    left: int,
    uses_amplitude: bool,
    pixels: NDArray[np.int64],
    returns: NDArray[np.float64],
) -> int:
    """Writes valid pixels (2, n) and their measurements (2, n); returns n.

    Some devices report infinity or a negative distance for a return out of range.
    """
    n = 0
    for row in range(distance.shape[0]):
        for column in range(distance.shape[1]):
            x, a = distance[row, column], amplitude[row, column]
            if x > 0 and np.isfinite(x) and (np.isfinite(a) or not uses_amplitude):
                pixels[0, n], pixels[1, n] = top + row, left + column
                returns[0, n], returns[1, n] = x, a
                n += 1
    return n


@kernel
def _write_texels(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    center: NDArray[np.float64],
    mean: NDArray[np.float64],
    deviation: NDArray[np.float64],
    normalizer: NDArray[np.float32],
    growth: NDArray[np.float32],
    texture: NDArray[np.float32],
) -> None:
    """Coefficients in t, in single precision, from values (3, n) at t = −WINDOW_M, 0, WINDOW_M.

    Logarithms (n,) are of the normaliser at 0, and of the ratio of the deviations at the ends.
    """
    slope, curvature = 1 / (2 * WINDOW_M), 1 / (2 * WINDOW_M**2)
    for k in range(center.size):
        texel = texture[rows[k] + 1, columns[k] + 1]
        near, here, far = deviation[0, k], deviation[1, k], deviation[2, k]
        inverse = 1 / (near * here * far)  # a division takes as long as ten products
        below, middle, above = inverse * here * far, inverse * near * far, inverse * near * here
        texel[0] = center[k]
        texel[1] = mean[1, k]
        texel[2] = (mean[2, k] - mean[0, k]) * slope
        texel[3] = middle
        texel[4] = (above - below) * slope
        texel[5] = (above - 2 * middle + below) * curvature
        texel[6], texel[7] = normalizer[k], growth[k] * slope
