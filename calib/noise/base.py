"""What a noise model is, and the texture into which every depth noise model is rendered (eqs. 17–19)."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.jit import kernel

#: Texels describe the density for |measured − mean offset − synthesised| up to this [m]; beyond, they keep their edge
#: value.
WINDOW_M = 0.05

#: No surface is nearer than this [m]; keeps the window's near end in front of the camera.
LEAST_DISTANCE_M = 1e-3

#: Pixels that are rendered at once: so many that calls cost little, so few that what lies between them stays in the
#: processor's memory.
_BLOCK = 32768

LOG_SQRT_2PI = 0.5 * np.log(2 * np.pi)

#: Values that a channel of a colour can have.
LEVELS = 256.0

#: Rows and columns of the pixels that measured, each (n,).
Pixels = tuple[NDArray[np.integer], NDArray[np.integer]]


class NoiseError(ValueError):
    """Parameters that describe no noise model; names the key and what is allowed."""


def pixels_where(mask: NDArray[np.bool_]) -> Pixels:
    """Rows and columns of the pixels at which an image (height, width) is true."""
    rows, columns = np.nonzero(mask)
    return rows, columns


@runtime_checkable
class DepthNoise(Protocol):
    """Gaussian noise of a distance measured by pixel p, given the real distance x [m] and the measured amplitude a.

    For a sensor that tells the σ of each measurement itself, a is that [m]. Arrays x may be (n,), one distance for each
    of n pixels, or (…, n), several; a is (n,).
    """

    @property
    def uses_amplitude(self) -> bool:
        """Whether μ or σ depends on the amplitude, so that a frame without one cannot be judged."""
        ...

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) of a measurement from the real distance [m], in the shape of x."""
        ...

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) of a measurement [m], always positive, in the shape of x."""
        ...


def log_density(model: DepthNoise, measured: ArrayLike, x: ArrayLike, a: ArrayLike, p: Pixels) -> NDArray[np.float64]:
    """Logarithm of eq. 18: density of measuring `measured` [m] at pixel p when the real distance is `x` [m]."""
    x, a = np.asarray(x, np.float64), np.asarray(a, np.float64)
    deviation = model.deviation(x, a, p)
    normalized = (np.asarray(measured) - x - model.mean(x, a, p)) / deviation
    return -0.5 * normalized**2 - np.log(deviation) - LOG_SQRT_2PI


def sample(
    model: DepthNoise, generator: np.random.Generator, x: ArrayLike, a: ArrayLike, p: Pixels
) -> NDArray[np.float64]:
    """Draws one measurement [m] for every real distance `x` [m] and amplitude `a` at the pixels `p`."""
    x, a = np.asarray(x, np.float64), np.asarray(a, np.float64)
    return x + model.mean(x, a, p) + model.deviation(x, a, p) * generator.standard_normal(x.shape)


def without_offset(
    model: DepthNoise, distance: NDArray[np.floating], amplitude: NDArray[np.floating]
) -> NDArray[np.float32]:
    """A depth image (height, width) [m] without the mean offset that each distance has if it is right."""
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

    Every noise model becomes the same texture, so all of them run at the same speed. With y the measurement without
    the mean offset that it has if it is right, and t = y − x, a texel holds [y, m0, m1, s0, s1, s2, n0, n1]: mean
    offset beyond that one m0 + m1 t, inverse deviation s0 + s1 t + s2 t², and the negative logarithm of the normaliser
    n0 + n1 t. Pixels without a return keep what they hold.

    Args:
        model: the noise model.
        distance: measured radial distances (rows, columns) [m], NaN without return.
        amplitude: measured amplitudes (rows, columns); ignored where the model does not depend on them.
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
    """Writes the texels of so few pixels that what lies between the steps stays in the processor's memory."""
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
    offset = model.mean(measured, a, p)  # may be larger than the window, which has to lie where the surface is
    center = measured - offset
    nodes = np.maximum(center + np.array([[WINDOW_M], [0.0], [-WINDOW_M]]), LEAST_DISTANCE_M)
    _write_texels(*p, center, model.mean(nodes, a, p) - offset, model.deviation(nodes, a, p), texture)


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
    """Lists the pixels (2, n) that can be judged with what they measured (2, n), and tells how many there are.

    Some devices report infinity, and some a negative distance, for what is out of range.
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
    texture: NDArray[np.float32],
) -> None:
    """Coefficients in t from the values (3, n) at t = −WINDOW_M, 0, WINDOW_M; texels have single precision only."""
    slope, curvature = 1 / (2 * WINDOW_M), 1 / (2 * WINDOW_M**2)
    last, normalizer, growth = np.zeros(3), np.float32(0), 0.0
    for k in range(center.size):
        texel = texture[rows[k] + 1, columns[k] + 1]
        near, here, far = deviation[0, k], deviation[1, k], deviation[2, k]
        below, middle, above = 1 / near, 1 / here, 1 / far
        if near != last[0] or here != last[1] or far != last[2]:  # a logarithm takes as long as all the rest
            last[0], last[1], last[2] = near, here, far
            normalizer = np.log(np.float32(here)) + np.float32(LOG_SQRT_2PI)
            growth = np.log(np.float32(far * below)) * slope
        texel[0] = center[k]
        texel[1] = mean[1, k]
        texel[2] = (mean[2, k] - mean[0, k]) * slope
        texel[3] = middle
        texel[4] = (above - below) * slope
        texel[5] = (above - 2 * middle + below) * curvature
        texel[6], texel[7] = normalizer, growth
