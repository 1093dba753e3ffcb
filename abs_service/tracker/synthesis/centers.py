"""Attributes of a surface at the centres of the pixels into which its vertices project."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel, prange


@kernel
def at_centers(
    steps: NDArray[np.float32],
    values: NDArray[np.float32],
    gradients: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """Value + gradient · step from the projection of the vertex to the centre of its pixel.

    Args:
        steps: to the right and down (2, population, n) [px].
        values: of the vertices (channels, n).
        gradients: to the right and down (channels, 2, n) [1/px].
        result: (population, channels, n).
    """
    for k in prange(result.shape[0]):
        rights, downs = steps[0, k], steps[1, k]
        for channel in range(values.shape[0]):
            own, right, down = values[channel], gradients[channel, 0], gradients[channel, 1]
            attributes = result[k, channel]
            for v in range(np.uintp(attributes.size)):
                attributes[v] = own[v] + right[v] * rights[v] + down[v] * downs[v]
