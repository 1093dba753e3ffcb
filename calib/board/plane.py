"""Distances that a depth sensor measures on the white parts of a board."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.target import Target
from calib.board.views import CornerView, PlaneView
from calib.camera import Camera
from calib.lenses.lens import LensError
from calib.pose import Pose

#: Erosion of regions [px], because distances at edges of squares and boards are mixed.
_RIM_PX = 2
#: Maximum number of pixels of a view; more add no information about a plane.
MAX_PIXELS = 2000
#: Minimum number of pixels.
MIN_PIXELS = 30
#: Minimum ratio of bright to dark amplitudes for a segmentation.
_CONTRAST = 1.5

Mask = NDArray[np.bool_]


def region(pixels: NDArray[np.float64], shape: tuple[int, int]) -> Mask:
    """Pixels (height, width) well inside the hull of points (n, 2) on a board."""
    inside = np.zeros(shape, np.uint8)
    hull = cv2.convexHull(np.ascontiguousarray(pixels, np.float32))
    cv2.fillConvexPoly(inside, np.rint(hull).astype(np.int32), 1)
    kernel = np.ones((2 * _RIM_PX + 1, 2 * _RIM_PX + 1), np.uint8)
    return cv2.erode(inside, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def white_pixels(amplitude: NDArray[np.integer | np.floating], inside: Mask) -> Mask:
    """Pixels of a region (height, width) on white; all of them if it contains no black, whose returns are weak."""
    low, high = np.percentile(amplitude[inside].astype(np.float64), (10, 90)) if inside.any() else (1.0, 1.0)
    return inside if high < _CONTRAST * low else inside & (amplitude > 0.5 * (low + high))


def plane_view(
    sensor: str,
    shot: int,
    t_s: float,
    inside: Mask,
    distance: NDArray[np.floating],
    sigma: NDArray[np.floating],
) -> PlaneView | None:
    """Distances that a sensor measured on a board, at most `MAX_PIXELS`; None with fewer than `MIN_PIXELS`.

    Args:
        sensor, shot, t_s: see `PlaneView`.
        inside: pixels (height, width) on the board: `region` and `white_pixels`.
        distance: radial distances (height, width) [m], NaN without return.
        sigma: their deviations (height, width) [m]; NaN is replaced by the scatter of neighbouring distances.
    """
    rows, columns = np.nonzero(inside & np.isfinite(distance))
    if len(rows) < MIN_PIXELS:
        return None
    chosen = np.linspace(0, len(rows) - 1, min(len(rows), MAX_PIXELS)).round().astype(int)
    rows, columns = rows[chosen], columns[chosen]
    known = sigma[rows, columns].astype(np.float64)
    return PlaneView(
        sensor=sensor,
        shot=shot,
        t_s=t_s,
        pixels=np.stack([columns, rows], axis=1).astype(np.float64),
        distances=distance[rows, columns].astype(np.float64),
        sigmas=np.where(known > 0, known, estimate_sigma(distance, inside)),
    )


def estimate_sigma(distance: NDArray[np.floating], inside: Mask) -> float:
    """Standard deviation of distances (height, width) in a region from pixel to pixel [m].

    Second differences along rows, x₂ − 2 x₁ + x₀, cancel a slope and have √6 times the deviation of independent noise.
    The quantisation step gives the lower bound 1/√12 of a step.
    """
    used = np.where(inside, distance, np.nan).astype(np.float64)
    differences = np.abs(np.diff(used, n=2, axis=1))
    differences = differences[~np.isnan(differences)]
    values = np.unique(used[~np.isnan(used)])
    step = float(np.min(np.diff(values))) if len(values) > 1 else 0.0
    noise = 1.4826 * float(np.median(differences)) / np.sqrt(6) if len(differences) else 0.0
    return max(noise, step / np.sqrt(12), 1e-5)


def board_pose(view: CornerView, camera: Camera) -> Pose | None:
    """Approximate pose `T_rb` of a board from one camera; None if undetermined."""
    try:
        rays = camera.directions(view.pixels)
    except LensError:
        return None
    ideal = np.ascontiguousarray(rays[:, :2] / rays[:, 2:])
    found, rotation, translation = cv2.solvePnP(view.points_b, ideal, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        return None
    return camera.T_rs @ pose.from_rotation_vector(rotation.ravel(), translation.ravel())


def projected_region(target: Target, T_rb: Pose, camera: Camera, slack_px: float) -> Mask:
    """Pixels (height, width) on the inner part of a board of approximately known pose, `slack_px` inside its points.

    For sensors that measure distances only. Empty if the board is not entirely in front of the camera.
    """
    shape = (camera.height, camera.width)
    pixels = camera.project(pose.transform(T_rb, target.points()))
    if not np.isfinite(pixels).all():
        return np.zeros(shape, np.bool_)
    middle = pixels.mean(axis=0)
    reach = np.linalg.norm(pixels - middle, axis=1).max()
    return region(middle + (pixels - middle) * max(1 - slack_px / max(reach, 1e-9), 0), shape)
