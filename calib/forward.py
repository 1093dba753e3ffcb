"""Forward distortion in single precision: of single points, for kernels that project many, and of images of them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from calib.fisheye import KannalaBrandt
from calib.jit import composed, kernel
from calib.lens import LensModel

#: Below this radius, in normalised coordinates, a fisheye does not bend in single precision.
_ON_AXIS = 1e-4


@kernel
def bend_fisheye(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Distorted from ideal normalised coordinates, for the four coefficients of a fisheye."""
    one = np.float32(1)
    radius = np.sqrt(x * x + y * y)
    theta = np.arctan(radius)
    t2 = theta * theta
    bent = theta * (one + t2 * (lens[0] + t2 * (lens[1] + t2 * (lens[2] + t2 * lens[3]))))
    scale = bent / radius if radius > np.float32(_ON_AXIS) else one
    return x * scale, y * scale


@kernel
def eight(lens: NDArray[np.float32]) -> tuple[np.float32, ...]:
    """The coefficients of a lens, for `bend`, as numbers, which stay where elements are read again."""
    return lens[0], lens[1], lens[2], lens[3], lens[4], lens[5], lens[6], lens[7]


@kernel
def four(lens: NDArray[np.float32]) -> tuple[np.float32, ...]:
    """The same of a fisheye, for `bend_fisheye`."""
    return lens[0], lens[1], lens[2], lens[3]


@kernel
def bend(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Distorted from ideal normalised coordinates, for the eight coefficients of any other lens."""
    one, two = np.float32(1), np.float32(2)
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    r2 = x * x + y * y
    radial = (one + r2 * (k1 + r2 * (k2 + r2 * k3))) / (one + r2 * (k4 + r2 * (k5 + r2 * k6)))
    right = x * radial + two * p1 * x * y + p2 * (r2 + two * x * x)
    return right, y * radial + p1 * (r2 + two * y * y) + two * p2 * x * y


@kernel
def straight(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """What `bend` is without distortion, whose coefficients are ignored."""
    return x, y


@kernel
def straighten(
    x: np.float32, y: np.float32, right: np.float32, down: np.float32, lens: tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """The small step (right, down) from (x, y) on as it is: what a lens other than a fisheye bends it by is little."""
    return right, down


@kernel
def straighten_fisheye(
    x: np.float32, y: np.float32, right: np.float32, down: np.float32, lens: tuple[np.float32, ...]
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


def projector(lens: LensModel) -> Callable[..., None]:
    """The kernel that takes ideal coordinates (h, w, 2) to pixels, in place; then come matrix and coefficients."""
    if isinstance(lens, KannalaBrandt):
        return _to_pixels_fisheye
    return _to_pixels_pinhole if lens.is_pinhole else _to_pixels


#: What a lens has; `composed` puts those of another in its place.
coefficients = eight


@kernel
def _to_pixels(place: NDArray[np.float32], matrix: NDArray[np.float32], lens: NDArray[np.float32]) -> None:
    (fx, fy, cx, cy), own_lens = matrix, coefficients(lens)
    for r in range(place.shape[0]):
        for c in range(place.shape[1]):
            x, y = bend(place[r, c, 0], place[r, c, 1], own_lens)
            place[r, c, 0] = fx * x + cx
            place[r, c, 1] = fy * y + cy


_to_pixels_pinhole: Callable[..., None] = composed(_to_pixels, bend=straight)
_to_pixels_fisheye: Callable[..., None] = composed(_to_pixels, bend=bend_fisheye, coefficients=four)
