"""Lenses of depthai's images in the models of `calib`.

depthai's perspective model is OpenCV's with up to 14 coefficients: Brown and Conrady's with a rational part, the
thin-prism terms s1 to s4, and the tilt of the sensor. `calib` has the first eight. What the others do is nearly what
other values of the first eight do to a camera that is turned a little: in first order, a thin prism is a decentred lens
that looks elsewhere.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from calib import pose
from calib.lenses.lens import Lens
from calib.pose import Pose

#: Number of coefficients that `Lens` has, and the maximum of depthai.
OWN, ALL = 8, 14

#: Coefficients that are fitted: k1, k2, p1, p2, k3. The denominator is kept, because another one may have poles beside
#: the image.
_FREE = 5

#: Points at which the models are compared, per side of the image.
_POINTS = 15


@dataclass(frozen=True, eq=False)
class FittedLens:
    """A lens with the camera matrix and the turn that belong to it.

    Attributes:
        lens: of eight coefficients.
        matrix: (fx, fy, cx, cy) [px].
        T_fitted_camera: rotation from the camera's coordinates to those in which the lens holds.
        worst_px: greatest distance between the models' pixels of one ray, over the image [px].
    """

    lens: Lens
    matrix: tuple[float, float, float, float]
    T_fitted_camera: Pose
    worst_px: float


def fitted(coefficients: NDArray[np.float64], matrix: NDArray[np.float64], size: tuple[int, int]) -> FittedLens:
    """The lens of eight coefficients nearest to one of up to 14, by least squares over the image; exact for eight.

    Args:
        coefficients: in OpenCV's order.
        matrix: camera matrix (3, 3) [px].
        size: width and height of the image [px].

    Raises:
        ValueError: coefficients that are none.
    """
    own = np.zeros(OWN)
    own[: min(OWN, len(coefficients))] = coefficients[:OWN]
    numbers = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])
    if not np.any(coefficients[OWN:]):
        return FittedLens(Lens(own), tuple(numbers.tolist()), pose.identity(), 0.0)
    full = np.zeros(ALL)
    full[: len(coefficients)] = coefficients
    corners = [np.linspace(-0.5, side - 0.5, _POINTS) for side in size]
    pixels = np.stack(np.meshgrid(*corners), axis=-1).reshape(-1, 1, 2)
    rays = np.insert(cv2.undistortPoints(pixels, matrix, full).reshape(-1, 2), 2, 1.0, axis=1)
    wanted, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, full)
    if not np.all(np.isfinite(wanted)):
        raise ValueError(f"a lens with the coefficients {full.tolist()} projects to no finite pixels")

    def errors(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        lens, matrix_of, T_fitted_camera = _parts(parameters, own)
        turned = rays @ T_fitted_camera[:3, :3].T
        distorted = lens.distort(turned[:, :2] / turned[:, 2:])
        return (matrix_of[:2] * distorted + matrix_of[2:] - wanted.reshape(-1, 2)).ravel()

    first = np.concatenate([own[:_FREE], numbers, np.zeros(3)])
    found = scipy.optimize.least_squares(errors, first, x_scale="jac")
    worst_px = float(np.hypot(*found.fun.reshape(-1, 2).T).max())
    lens, numbers, T_fitted_camera = _parts(found.x, own)
    return FittedLens(lens, tuple(numbers.tolist()), T_fitted_camera, worst_px)


def _parts(parameters: NDArray[np.float64], own: NDArray[np.float64]) -> tuple[Lens, NDArray[np.float64], Pose]:
    """Lens, (fx, fy, cx, cy) and turn of a fit's parameters."""
    lens = Lens(np.concatenate([parameters[:_FREE], own[_FREE:]]))
    return lens, parameters[_FREE : _FREE + 4], pose.from_rotation_vector(parameters[_FREE + 4 :], (0, 0, 0))
