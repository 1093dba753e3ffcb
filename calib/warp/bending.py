"""Interpolation error: deviation of a surface from the flat faces between its measured points."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Root mean square of t (1 − t) / 2 over a step: error of linear interpolation per second difference.
_PER_DIFFERENCE = 1 / np.sqrt(120)


@kernel
def bending(
    distance: NDArray[np.float32], sigma: NDArray[np.float32], maximum_step: float, result: NDArray[np.float32]
) -> None:
    """Root mean square error (h, w) [m] of linear interpolation around every pixel, from the second differences.

    The variance 6 σ² that noise of deviation `sigma` contributes to them is subtracted. An axis on which a neighbour is
    missing, or belongs to another surface, contributes nothing.
    """
    height, width = distance.shape
    for row in range(height):
        for column in range(width):
            total, d = np.float32(0), distance[row, column]
            for axis in range(2):
                r, c = (1, 0) if axis == 0 else (0, 1)
                if row < r or column < c or row + r >= height or column + c >= width:
                    continue
                before, after = distance[row - r, column - c], distance[row + r, column + c]
                if abs(before - d) <= maximum_step and abs(after - d) <= maximum_step:
                    second = before - np.float32(2) * d + after
                    excess = second * second - np.float32(6) * sigma[row, column] ** 2
                    total += max(excess, np.float32(0))
            result[row, column] = np.sqrt(total) * np.float32(_PER_DIFFERENCE)
