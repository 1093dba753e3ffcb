"""What a depth sensor says of a board: its distances where the board's white is, and nothing beside it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.target import Target
from calib.camera import Camera
from calib.lens import LensError
from calib.pose import Pose
from calib.views import CornerView, PlaneView

#: Distances at rims of squares and boards are mixtures; so many pixels are left out along the region's edge.
_RIM_PX = 2
#: More pixels say no more about a plane that is held once.
MOST_PIXELS = 2000
#: Fewer say nothing.
LEAST_PIXELS = 30
#: Dark and bright amplitudes are told apart where one is this many times the other.
_CONTRAST = 1.5

Mask = NDArray[np.bool_]


def region(pixels: NDArray[np.float64], shape: tuple[int, int]) -> Mask:
    """Pixels (height, width) well inside the hull of points (n, 2) on a board."""
    inside = np.zeros(shape, np.uint8)
    hull = cv2.convexHull(np.ascontiguousarray(pixels, np.float32))
    cv2.fillConvexPoly(inside, np.rint(hull).astype(np.int32), 1)
    kernel = np.ones((2 * _RIM_PX + 1, 2 * _RIM_PX + 1), np.uint8)
    return cv2.erode(inside, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def bright(amplitude: NDArray[np.integer | np.floating], inside: Mask) -> Mask:
    """The pixels of a region (height, width) on white, if there is black in it at all; the others have weak returns."""
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
    """The distances that a sensor measured on a board.

    Args:
        sensor, shot, t_s: as of a `PlaneView`.
        inside: pixels (height, width) on the board, `region` of it and `bright`.
        distance: radial distances (height, width) [m], NaN without return.
        sigma: their deviations (height, width) [m]; where they are NaN, what neighbouring distances scatter by.

    Returns:
        The view, thinned out to `MOST_PIXELS`; None if there are fewer than `LEAST_PIXELS` distances.
    """
    rows, columns = np.nonzero(inside & np.isfinite(distance))
    if len(rows) < LEAST_PIXELS:
        return None
    chosen = np.linspace(0, len(rows) - 1, min(len(rows), MOST_PIXELS)).round().astype(int)
    rows, columns = rows[chosen], columns[chosen]
    known = sigma[rows, columns].astype(np.float64)
    return PlaneView(
        sensor=sensor,
        shot=shot,
        t_s=t_s,
        pixels=np.stack([columns, rows], axis=1).astype(np.float64),
        distances=distance[rows, columns].astype(np.float64),
        sigmas=np.where(known > 0, known, scatter(distance, inside)),
    )


def scatter(distance: NDArray[np.floating], inside: Mask) -> float:
    """What distances (height, width) in a region scatter by from pixel to pixel [m].

    Second differences along rows, x₂ − 2 x₁ + x₀, cancel a slope and have √6 times the deviation of independent noise.
    Steps in which distances come are at least a part of what they scatter by, 1/√12 of a step.
    """
    used = np.where(inside, distance, np.nan).astype(np.float64)
    differences = np.abs(np.diff(used, n=2, axis=1))
    differences = differences[~np.isnan(differences)]
    values = np.unique(used[~np.isnan(used)])
    step = float(np.min(np.diff(values))) if len(values) > 1 else 0.0
    noise = 1.4826 * float(np.median(differences)) / np.sqrt(6) if len(differences) else 0.0
    return max(noise, step / np.sqrt(12), 1e-5)


def board_pose(view: CornerView, camera: Camera) -> Pose | None:
    """Roughly where a board is, `T_rb`, as one camera sees it; None if it cannot be told.

    Args:
        view: four corners or more.
        camera: of the view's sensor.
    """
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
    """Pixels (height, width) that see the inner part of a board of roughly known pose, `slack_px` inside its points.

    For sensors that measure distances and see no print. Empty if the board is not wholly in front of the camera.
    """
    shape = (camera.height, camera.width)
    pixels = camera.project(pose.transform(T_rb, target.points()))
    if not np.isfinite(pixels).all():
        return np.zeros(shape, np.bool_)
    middle = pixels.mean(axis=0)
    reach = np.linalg.norm(pixels - middle, axis=1).max()
    return region(middle + (pixels - middle) * max(1 - slack_px / max(reach, 1e-9), 0), shape)
