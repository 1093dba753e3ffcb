"""Forward distortion of single points, for kernels that project many: `distort` in single precision."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Below this radius, in normalised coordinates, a fisheye does not bend in single precision.
_ON_AXIS = 1e-4


@kernel
def bend_fisheye(x: np.float32, y: np.float32, lens: NDArray[np.float32]) -> tuple[np.float32, np.float32]:
    """Distorted from ideal normalised coordinates, for the four coefficients of a fisheye."""
    one = np.float32(1)
    radius = np.sqrt(x * x + y * y)
    theta = np.arctan(radius)
    t2 = theta * theta
    bent = theta * (one + t2 * (lens[0] + t2 * (lens[1] + t2 * (lens[2] + t2 * lens[3]))))
    scale = bent / radius if radius > np.float32(_ON_AXIS) else one
    return x * scale, y * scale


@kernel
def straighten_fisheye(
    x: np.float32, y: np.float32, right: np.float32, down: np.float32, lens: NDArray[np.float32]
) -> tuple[np.float32, np.float32]:
    """The step in ideal coordinates from (x, y) on that the lens bends into a small step (right, down)."""
    one = np.float32(1)
    radius = np.sqrt(x * x + y * y)
    if not radius > np.float32(_ON_AXIS):
        return right, down
    theta = np.arctan(radius)
    t2 = theta * theta
    bent = theta * (one + t2 * (lens[0] + t2 * (lens[1] + t2 * (lens[2] + t2 * lens[3]))))
    slope = one + t2 * (
        np.float32(3) * lens[0]
        + t2 * (np.float32(5) * lens[1] + t2 * (np.float32(7) * lens[2] + t2 * np.float32(9) * lens[3]))
    )
    around = radius / bent
    outward = ((one + radius * radius) / slope - around) * (x * right + y * down) / (radius * radius)
    return right * around + x * outward, down * around + y * outward
