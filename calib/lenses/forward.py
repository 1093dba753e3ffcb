"""Forward distortion in single precision: kernels for single points and for images of points."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from calib.jit import composed, kernel
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import LensModel

#: Below this radius, in normalised coordinates, fisheye distortion vanishes in single precision.
_ON_AXIS = 1e-4


@kernel
def distort_fisheye(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Fisheye distortion of ideal normalised coordinates; four coefficients."""
    one = np.float32(1)
    radius = np.sqrt(x * x + y * y)
    theta = np.arctan(radius)
    t2 = theta * theta
    bent = theta * (one + t2 * (lens[0] + t2 * (lens[1] + t2 * (lens[2] + t2 * lens[3]))))
    scale = bent / radius if radius > np.float32(_ON_AXIS) else one
    return x * scale, y * scale


@kernel
def brown_conrady_coefficients(lens: NDArray[np.float32]) -> tuple[np.float32, ...]:
    """Brown–Conrady coefficients as scalars, which stay in registers."""
    return lens[0], lens[1], lens[2], lens[3], lens[4], lens[5], lens[6], lens[7]


@kernel
def fisheye_coefficients(lens: NDArray[np.float32]) -> tuple[np.float32, ...]:
    """Fisheye coefficients as scalars, which stay in registers."""
    return lens[0], lens[1], lens[2], lens[3]


@kernel
def distort(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Brown–Conrady distortion of ideal normalised coordinates; brown_conrady_coefficients coefficients."""
    one, two = np.float32(1), np.float32(2)
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    r2 = x * x + y * y
    radial = (one + r2 * (k1 + r2 * (k2 + r2 * k3))) / (one + r2 * (k4 + r2 * (k5 + r2 * k6)))
    right = x * radial + two * p1 * x * y + p2 * (r2 + two * x * x)
    return right, y * radial + p1 * (r2 + two * y * y) + two * p2 * x * y


@kernel
def without_distortion(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Identity in place of `distort` for a lens without distortion."""
    return x, y


@kernel
def undistort_step(
    x: np.float32, y: np.float32, right: np.float32, down: np.float32, lens: tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Undistorted small step (right, down) at (x, y); approximated by the step itself."""
    return right, down


@kernel
def undistort_step_fisheye(
    x: np.float32, y: np.float32, right: np.float32, down: np.float32, lens: tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Undistorted small step at (x, y): the step in ideal coordinates that the fisheye maps to (right, down)."""
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
    """Kernel that maps ideal coordinates (h, w, 2) to pixels in place; its arguments end in matrix and coefficients."""
    if isinstance(lens, KannalaBrandt):
        return _to_pixels_fisheye
    return _to_pixels_pinhole if lens.is_pinhole else _to_pixels


#: Reads the coefficients of the lens; `composed` replaces it.
coefficients = brown_conrady_coefficients


@kernel
def _to_pixels(place: NDArray[np.float32], matrix: NDArray[np.float32], lens: NDArray[np.float32]) -> None:
    (fx, fy, cx, cy), own_lens = matrix, coefficients(lens)
    for r in range(place.shape[0]):
        for c in range(place.shape[1]):
            x, y = distort(place[r, c, 0], place[r, c, 1], own_lens)
            place[r, c, 0] = fx * x + cx
            place[r, c, 1] = fy * y + cy


_to_pixels_pinhole: Callable[..., None] = composed(_to_pixels, distort=without_distortion)
_to_pixels_fisheye: Callable[..., None] = composed(
    _to_pixels, distort=distort_fisheye, coefficients=fisheye_coefficients
)
