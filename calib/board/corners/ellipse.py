"""Bias of a disc's image: its centre of area is not the image of the disc's centre, by perspective and by the lens."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.target import AsymmetricCircles, Circles

#: Largest degree of the polynomials that describe what a homography leaves, and least number of discs for each
#: coefficient of one coordinate.
_DEGREE, _FOR_EACH = 4, 3

#: Number of points on the rim of a disc.
_RIM = 32

Array = NDArray[np.float64]


def center_bias(target: Circles | AsymmetricCircles, ids: NDArray[np.intp], pixels: Array) -> Array:
    """Centre of each disc's image minus the image of its centre (n, 2) [px].

    The rim of each disc is mapped by a homography of the board's plane and polynomials of what it leaves, such as of a
    lens, both fitted to all centres. By a homography alone the image is an ellipse (J. Heikkilä, PAMI 2000).
    """
    points = target.points()[ids, :2]
    H, _ = cv2.findHomography(points, pixels)
    if H is None:
        return np.zeros_like(pixels)
    low, high = points.min(axis=0), points.max(axis=0)
    degree = max((d for d in range(2, _DEGREE + 1) if _FOR_EACH * (d + 1) * (d + 2) // 2 <= len(points)), default=0)

    def basis(places: Array) -> Array:
        x, y = ((2 * places - low - high) / (high - low).max()).T
        return np.stack([x ** (of - power) * y**power for of in range(degree + 1) for power in range(of + 1)], axis=1)

    left = pixels - cv2.perspectiveTransform(points[:, None], H)[:, 0]
    coefficients = np.linalg.lstsq(basis(points), left, rcond=None)[0] if degree else np.zeros((1, 2))

    def mapped(places: Array) -> Array:
        return cv2.perspectiveTransform(places[:, None], H)[:, 0] + basis(places) @ coefficients

    angles = 2 * np.pi * np.arange(_RIM) / _RIM
    # The polygon has the area of the disc.
    radius = target.diameter / 2 * np.sqrt(2 * np.pi / (_RIM * np.sin(2 * np.pi / _RIM)))
    rim = points[:, None] + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    centers = mapped(points)
    return _centroid(mapped(rim.reshape(-1, 2)).reshape(rim.shape) - centers[:, None])


def _centroid(polygons: Array) -> Array:
    """Centres of area (n, 2) of polygons (n, m, 2)."""
    following = np.roll(polygons, -1, axis=1)
    areas = polygons[..., 0] * following[..., 1] - polygons[..., 1] * following[..., 0]
    return np.sum((polygons + following) * areas[..., None], axis=1) / (3 * areas.sum(axis=1)[:, None])
