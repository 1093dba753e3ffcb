"""Forward distortion in single precision: kernels for single points and for images of points."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.jit import composed, kernel
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import LensModel

#: Smallest squared radius, in normalised coordinates, by which is divided; below it, a fisheye bends nothing.
_ON_AXIS = 1e-12


@kernel
def angle_per_radius(square: np.float32) -> np.float32:
    """Angle from the axis divided by its tangent r, arctan(r) / r, from r².

    With c = cos θ = 1/√(1 + r²) that is c · θ / sin θ, and θ / sin θ is smooth in 1 − c from 0 to 1: its interpolation
    of degree 9 at Chebyshev nodes errs by 2e-8. With arctangents, synthesis would take more than twice as long.
    """
    c = np.float32(1) / np.sqrt(np.float32(1) + square)
    x = np.float32(1) - c
    turn = np.float32(0.011162824)
    turn = turn * x + np.float32(-0.032591689)
    turn = turn * x + np.float32(0.050975759)
    turn = turn * x + np.float32(-0.033552998)
    turn = turn * x + np.float32(0.030059176)
    turn = turn * x + np.float32(0.020163490)
    turn = turn * x + np.float32(0.057977802)
    turn = turn * x + np.float32(0.133266572)
    turn = turn * x + np.float32(0.333335381)
    turn = turn * x + np.float32(0.999999990)
    return c * turn


@kernel
def distort_fisheye(
    x: np.float32, y: np.float32, lens: NDArray[np.float32] | tuple[np.float32, ...]
) -> tuple[np.float32, np.float32]:
    """Fisheye distortion of ideal normalised coordinates; four coefficients."""
    square = x * x + y * y
    bent = angle_per_radius(square)
    t2 = square * bent * bent
    scale = bent * (np.float32(1) + t2 * (lens[0] + t2 * (lens[1] + t2 * (lens[2] + t2 * lens[3]))))
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
    """Brown–Conrady distortion of ideal normalised coordinates; eight coefficients."""
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
    one, square = np.float32(1), x * x + y * y
    bent = angle_per_radius(square)
    t2 = square * bent * bent
    scale = bent * (one + t2 * (lens[0] + t2 * (lens[1] + t2 * (lens[2] + t2 * lens[3]))))
    slope = one + t2 * (
        np.float32(3) * lens[0]
        + t2 * (np.float32(5) * lens[1] + t2 * (np.float32(7) * lens[2] + t2 * np.float32(9) * lens[3]))
    )
    # 1 / scale around the axis, (1 + r²) / slope away from it; with one division for both.
    divisor = max(square, np.float32(_ON_AXIS))
    share = one / (slope * scale * divisor)
    outward = ((one + square) * scale - slope) * (x * right + y * down) * share
    around = slope * divisor * share
    return right * around + x * outward, down * around + y * outward


def lens_parts(lens: LensModel) -> dict[str, Callable[..., Any]]:
    """Parts of a lens for `composed`, by the names of a kernel that is written for Brown–Conrady lenses."""
    if isinstance(lens, KannalaBrandt):
        return {
            "distort": distort_fisheye,
            "coefficients": fisheye_coefficients,
            "undistort_step": undistort_step_fisheye,
        }
    return {"distort": without_distortion} if lens.is_pinhole else {}


def projector(lens: LensModel) -> Callable[..., None]:
    """Kernel that maps ideal coordinates (h, w, 2) to pixels in place; its arguments end in matrix and coefficients."""
    return composed(_to_pixels, **lens_parts(lens))


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
