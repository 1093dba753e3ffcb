"""The texture into which every depth noise model is rendered (eqs. 17–19), so that all run at the same speed."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel
from calib.noise.base import LOG_SQRT_2PI, DepthNoise

#: Half width of the interval of measured − mean offset − synthesised distance that a texel describes [m]; outside, the
#: edge value applies.
WINDOW_M = 0.05
_NODES_M = np.array([[WINDOW_M], [0.0], [-WINDOW_M]])

#: Smallest distance of a surface [m]; keeps the near end of the interval in front of the camera.
MIN_DISTANCE_M = 1e-3

#: Pixels rendered in one call: few enough that intermediate results stay in the cache, many enough to amortise the
#: call.
_BLOCK = 32768

#: Rows and columns of pixels, each (n,).
Found = tuple[NDArray[np.int64], NDArray[np.int64]]


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
    for top, block in _blocks(distance.shape):
        p, measured, a = _found(model, distance[block], amplitude[block], (corner[0] + top, corner[1]))
        _render(model, measured, a, p, texture)


def corrected_distances(
    model: DepthNoise, distance: NDArray[np.float32], amplitude: NDArray[np.float32], corner: tuple[int, int]
) -> NDArray[np.float32]:
    """Measurements minus the mean offset there, y of `write_texture` (rows, columns) [m]; NaN without a return.

    Args:
        model, distance, amplitude, corner: as in `write_texture`.
    """
    result = np.full(distance.shape, np.float32(np.nan))
    for top, block in _blocks(distance.shape):
        (rows, columns), measured, a = _found(model, distance[block], amplitude[block], (corner[0] + top, corner[1]))
        offset = model.mean(measured, a, (rows, columns))
        _write_distances(rows, columns, measured, offset, *corner, result)
    return result


def write_pixels(
    model: DepthNoise,
    measured: NDArray[np.float64],
    a: NDArray[np.float64],
    p: Found,
    texture: NDArray[np.float32],
) -> None:
    """`write_texture` for single pixels with a return.

    Args:
        model: the noise model.
        measured, a: their measured distances [m] and amplitudes (n,).
        p: their rows and columns in the image.
        texture: of the whole image.
    """
    for first in range(0, len(measured), _BLOCK):
        block = slice(first, first + _BLOCK)
        _render(model, measured[block], a[block], (p[0][block], p[1][block]), texture)


def normalizers(
    model: DepthNoise, measured: NDArray[np.float64], a: NDArray[np.float64], p: Found
) -> NDArray[np.float32]:
    """Negative logarithms of the normaliser, n0 of `write_texture`, of single pixels with a return (n,).

    Args:
        model, measured, a, p: as in `write_pixels`.
    """
    center = np.maximum(measured - model.mean(measured, a, p), MIN_DISTANCE_M)
    return _logarithms(model.deviation(center, a, p))[0] + np.float32(LOG_SQRT_2PI)


def _logarithms(*values: NDArray[np.float64]) -> tuple[NDArray[np.float32], ...]:
    """Logarithms in single precision; NumPy takes those of many numbers at once, the compiler does not."""
    with np.errstate(over="ignore"):  # farther than 1 km, single precision has no room for every model's deviation
        return tuple(np.log(one.astype(np.float32)) for one in values)


def _blocks(shape: tuple[int, ...]) -> Iterator[tuple[int, slice]]:
    """First row and rows of the blocks of a part of an image (rows, columns)."""
    rows = max(1, _BLOCK // max(shape[1], 1))
    for top in range(0, shape[0], rows):
        yield top, slice(top, top + rows)


def _found(
    model: DepthNoise, distance: NDArray[np.float32], amplitude: NDArray[np.float32], corner: tuple[int, int]
) -> tuple[Found, NDArray[np.float64], NDArray[np.float64]]:
    """Pixels with a return, and their distances and amplitudes, (n,)."""
    pixels, returns = np.empty((2, distance.size), np.int64), np.empty((2, distance.size))
    images = np.ascontiguousarray(distance, np.float32), np.ascontiguousarray(amplitude, np.float32)
    n = _returns(*images, *corner, model.uses_amplitude, pixels, returns)
    return (pixels[0, :n], pixels[1, :n]), returns[0, :n], returns[1, :n]


def _render(
    model: DepthNoise,
    measured: NDArray[np.float64],
    a: NDArray[np.float64],
    p: Found,
    texture: NDArray[np.float32],
) -> None:
    """Writes the texels of so few pixels that the cache holds them."""
    offset = model.mean(measured, a, p)  # may exceed the interval, which is centred on the surface
    center = measured - offset
    nodes = np.maximum(center + _NODES_M, MIN_DISTANCE_M)
    deviation = model.deviation(nodes, a, p)
    spread, growth = _logarithms(deviation[1], deviation[2] / deviation[0])
    normalizer = spread + np.float32(LOG_SQRT_2PI)
    _write_texels(*p, center, model.mean(nodes, a, p) - offset, deviation, normalizer, growth, texture)


@kernel
def _write_distances(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    measured: NDArray[np.float64],
    offset: NDArray[np.float64],
    top: int,
    left: int,
    result: NDArray[np.float32],
) -> None:
    """Writes measured − offset (n,) into a part of an image, whose first pixel is (top, left)."""
    for k in range(measured.size):
        result[rows[k] - top, columns[k] - left] = measured[k] - offset[k]


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
