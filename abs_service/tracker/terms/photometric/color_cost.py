"""Kernels for colour images: residuals and cost of the samples."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel, prange


@kernel
def color_residuals(
    pixel: NDArray[np.int32],
    colors: NDArray[np.float32],
    texture: NDArray[np.float32],
    inverse: NDArray[np.float32],
    residual: NDArray[np.float64],
    square: NDArray[np.float64],
) -> None:
    """Writes (measured − expected) / σ (n, 3) and its squared length (n,), infinite where nothing is measured.

    Args:
        pixel, colors: of the samples (n,) and (3, n), see `Synthesis`.
        texture, inverse: colours of the pixels (pixels, 3), and inverse deviations (n or 1, 3), see `ObservedColor`.
        residual, square: results.
    """
    shared = inverse.shape[0] == 1
    for v in range(pixel.size):
        measured, row, total = texture[max(pixel[v], 0)], (0 if shared else v), 0.0
        for c in range(3):
            residual[v, c] = (np.float64(measured[c]) - colors[c, v]) * inverse[row, c]
            total += residual[v, c] * residual[v, c]
        square[v] = total
        if not (pixel[v] > 0 and total < 1e60):  # NaN is no number below it
            square[v] = np.inf
            for c in range(3):
                residual[v, c] = np.inf


@kernel
def color_cost(
    pixel: NDArray[np.int32],
    colors: NDArray[np.float32],
    texture: NDArray[np.float32],
    inverse: NDArray[np.float32],
    normalizer: NDArray[np.float32],
    outlier: float,
    uniform: float,
    out: NDArray[np.float64],
) -> None:
    """Sum over samples of min(normaliser + ½e², outlier), of as many samples as have noise of their own, or of all.

    Samples with an unknown colour (NaN) cost `uniform`, occluded ones (∞) the mean of an inlier.
    """
    half, most, unknown, average = np.float32(0.5), np.float32(outlier), np.float32(uniform), np.float32(1.5)
    farthest = np.float32(1e30)  # np.isfinite does not survive reordered sums
    shared = inverse.shape[0] == 1
    # No branches on what is measured, see `depth_cost._cost_of`.
    for k in prange(pixel.shape[0]):
        total, pixels, expected = 0.0, pixel[k], colors[np.intp(k) % colors.shape[0]]
        for v in range(np.uintp(pixels.size)):
            i = pixels[v]
            measured = texture[np.uintp(max(i, 0))]
            row = np.uintp(0) if shared else v
            red = (measured[0] - expected[0, v]) * inverse[row, 0]
            green = (measured[1] - expected[1, v]) * inverse[row, 1]
            blue = (measured[2] - expected[2, v]) * inverse[row, 2]
            square = red * red + green * green + blue * blue
            explained = min(normalizer[row] + half * square, most)
            cost = average + normalizer[row] if square > farthest else explained
            cost = unknown if np.isnan(square) else cost
            total += cost if i >= 0 else np.float32(0)
        out[k] = total
