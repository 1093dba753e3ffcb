"""Directions in which the pixels of a camera look."""

import numpy as np
from numpy.typing import NDArray

from abs_client.camera import Camera

#: Iterations of the inverse of a lens, and the largest error that they may leave [px].
ITERATIONS, ERROR_PX = 40, 0.05


def axial_shares(camera: Camera, distorted: bool) -> NDArray[np.float32]:
    """Distance along the optical axis per distance from the camera centre (height, width); NaN where it is unknown.

    Args:
        camera: the camera.
        distorted: False if the images are without its lens distortion.
    """
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    seen = np.stack([(u - camera.K[0, 2]) / camera.K[0, 0], (v - camera.K[1, 2]) / camera.K[1, 1]])
    bends = distorted and (any(camera.lens) or camera.lens_model == "fisheye")  # equidistant without coefficients
    xy = _inverse(camera, seen) if bends else seen
    return (1.0 / np.sqrt(1.0 + (xy * xy).sum(axis=0))).astype(np.float32)


def _inverse(camera: Camera, seen: NDArray[np.float64]) -> NDArray[np.float64]:
    # Fixed-point iteration, as in OpenCV's undistortPoints; beyond the field of the lens it does not converge.
    distort = _fisheye if camera.lens_model == "fisheye" else _brown_conrady
    lens, xy = np.pad(np.array(camera.lens, float), (0, 8 - len(camera.lens))), seen
    with np.errstate(all="ignore"):
        for _ in range(ITERATIONS):
            scale, shift = distort(xy, lens)
            xy = (seen - shift) / scale
        scale, shift = distort(xy, lens)
        error = np.abs(xy * scale + shift - seen).max(axis=0) * camera.K[0, 0]
    return np.where(error < ERROR_PX, xy, np.nan)


def _brown_conrady(xy: NDArray[np.float64], lens: NDArray[np.float64]) -> tuple[NDArray, NDArray | float]:
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    x, y = xy
    square = x * x + y * y
    above, below = (1 + square * (a + square * (b + square * c)) for a, b, c in ((k1, k2, k3), (k4, k5, k6)))
    shift_x, shift_y = 2 * p1 * x * y + p2 * (square + 2 * x * x), p1 * (square + 2 * y * y) + 2 * p2 * x * y
    return above / below, np.stack([shift_x, shift_y])


def _fisheye(xy: NDArray[np.float64], lens: NDArray[np.float64]) -> tuple[NDArray, NDArray | float]:
    k1, k2, k3, k4 = lens[:4]
    radius = np.maximum(np.hypot(*xy), 1e-12)
    angle = np.arctan(radius)
    square = angle * angle
    return angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4)))) / radius, 0.0
