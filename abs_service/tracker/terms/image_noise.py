"""Noise of an image, found in the image itself."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Median of the absolute value of a normal distribution, in standard deviations.
NORMAL_MEDIAN = 0.6745

#: Median of the sum of the products of two second differences, without its sign, with noise of deviation 1.
_MEDIAN_LEFT = 6 * NORMAL_MEDIAN


def noise_deviation(image: NDArray[np.float32] | NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation (channels,) of the noise of an image's pixels, from those around places (n, 2); 0 if unknown.

    The difference of two Laplacians leaves noise, and little of a picture (J. Immerkær: Fast noise variance estimation.
    Computer Vision and Image Understanding 64, 1996); here its median, which edges hardly change.
    """
    left = np.empty((image.shape[2], len(places)))
    count = _laplacians(image, places, left)
    if not count:
        return np.zeros(len(left))
    # Not in the kernel: Numba's median takes two seconds to compile.
    lower, upper = (count - 1) // 2, count // 2
    ordered = np.partition(left[:, :count], (lower, upper), axis=1)
    return (ordered[:, lower] + ordered[:, upper]) / (2 * _MEDIAN_LEFT)


@kernel
def _laplacians(
    image: NDArray[np.float32] | NDArray[np.uint8], places: NDArray[np.float64], left: NDArray[np.float64]
) -> int:
    """Fills `left` (channels, n) with |Σ s_i s_j I_ij|, s = (1, −2, 1), around places (n, 2) [px]; number of the known.

    A candidate may lie behind the camera, or far beside the image; one unknown pixel leaves out all channels.
    """
    height, width, channels = image.shape
    count = 0
    for v in range(places.shape[0]):
        x, y = places[v, 0] + 0.5, places[v, 1] + 0.5
        if not (abs(x) < 1e9 and abs(y) < 1e9):
            continue
        column, row = min(max(int(np.floor(x)), 0), width - 1), min(max(int(np.floor(y)), 0), height - 1)
        is_known = True
        for c in range(channels):
            total = 0.0
            for i in range(-1, 2):
                line = image[min(max(row + i, 0), height - 1)]
                for j in range(-1, 2):
                    total += (3 * abs(i) - 2) * (3 * abs(j) - 2) * float(line[min(max(column + j, 0), width - 1), c])
            left[c, count] = abs(total)
            is_known = is_known and abs(total) < 1e30
        count += 1 if is_known else 0
    return count
