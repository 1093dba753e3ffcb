"""Kernels for images of one value per pixel: texture and cost of the samples."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel, prange

#: Components of a texel of a channel image: measured value, channel, inverse deviation, log of the normaliser.
VALUE, CHANNEL, INVERSE, NORMALIZER = range(4)


@kernel
def fill(
    values: NDArray[np.float32],
    channels: NDArray[np.uint8],
    deviation: NDArray[np.float32],
    constant: float,
    top: int,
    left: int,
    texels: NDArray[np.float32],
) -> None:
    """Texels (height, width, 4) of an image from a part of it, the deviation there and the image's pattern of channels.

    Args:
        values, deviation: of the part (rows, columns).
        channels: the pattern.
        constant: added to the logarithm of the deviation.
        top, left: the part's first pixel in the image.
        texels: result.
    """
    rows, columns = channels.shape
    last, inverse, normalizer = np.float32(-1), np.float32(0), np.float32(0)
    for row in range(values.shape[0]):
        part = left % columns
        for column in range(values.shape[1]):
            texel, sigma = texels[top + row, left + column], deviation[row, column]
            if sigma != last:  # most often they are all alike, and a logarithm takes as long as all the rest
                last, inverse, normalizer = sigma, np.float32(1) / sigma, np.log(sigma) + np.float32(constant)
            texel[VALUE] = values[row, column]
            texel[CHANNEL] = channels[(top + row) % rows, part]
            part = part + 1 if part + 1 < columns else 0
            texel[INVERSE] = inverse
            texel[NORMALIZER] = normalizer


@kernel
def copy(
    image: NDArray[np.float32], top: int, bottom: int, left: int, right: int, texture: NDArray[np.float32]
) -> None:
    """Rows and columns of an image (height, width, 4) into one with a border; what is unknown has the channel 0."""
    for row in range(top, bottom):
        for column in range(left, right):
            for part in range(4):
                value = image[row, column, part]
                texture[row + 1, column + 1, part] = np.float32(0) if part == CHANNEL and np.isnan(value) else value


@kernel
def channel_cost(
    pixel: NDArray[np.int32],
    appearance: NDArray[np.float32],
    texture: NDArray[np.float32],
    factor: NDArray[np.float32],
    log_factor: NDArray[np.float32],
    outlier: float,
    uniform: float,
    out: NDArray[np.float64],
) -> None:
    """Sum over samples of min(normaliser + ½e², outlier), with deviations widened by `Widening`.

    Samples whose value or appearance is unknown (NaN) cost `uniform`, occluded ones (∞) the mean of an inlier. Texels
    are [value, channel, inverse deviation, normaliser].
    """
    half, most, unknown = np.float32(0.5), np.float32(outlier), np.float32(uniform)
    farthest = np.float32(1e30)  # np.isfinite does not survive reordered sums
    samples, channels = factor.shape
    # No branches on what is measured, see `depth_cost._cost_of`.
    for k in prange(pixel.shape[0]):
        total, pixels, expected = 0.0, pixel[k], appearance[np.intp(k) % appearance.shape[0]]
        for v in range(np.uintp(pixels.size)):
            i = pixels[v]
            texel = texture[np.uintp(max(i, 0))]
            channel = np.uintp(np.int32(texel[1]))
            row, column = (v if samples > 1 else np.uintp(0)), (channel if channels > 1 else np.uintp(0))
            e = (texel[0] - expected[channel, v]) * texel[2] / factor[row, column]
            normalizer = texel[3] + log_factor[row, column]
            explained = min(half * e * e + normalizer, most)
            cost = half + normalizer if abs(e) > farthest else explained
            cost = unknown if np.isnan(e) else cost
            total += cost if i >= 0 else np.float32(0)
        out[k] = total
