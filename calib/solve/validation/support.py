"""Image region supported by corners, and where they are; outside it the lens is extrapolated."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.solve.solution import Solution


def supported(solution: Solution, sensor: str, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of pixels (n, 2) in the hull of the sensor's corners, or in the image if its intrinsics are fixed."""
    if not solution.adjustment.layout.free_parameters[sensor].intrinsics:
        camera = solution.cameras[sensor]
        with np.errstate(invalid="ignore"):
            return np.all((pixels >= -0.5) & (pixels <= (camera.width - 0.5, camera.height - 0.5)), axis=1)
    corners = [view.pixels for view in solution.task.corners if view.sensor == sensor]
    return in_hull(np.concatenate(corners), pixels)


def in_hull(corners: NDArray[np.floating], pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of pixels (n, 2) in the hull of corners (m, 2); NaN is outside."""
    hull = np.asarray(cv2.convexHull(corners.astype(np.float32)), np.float32)
    sides = [cv2.pointPolygonTest(hull, (u, v), False) for u, v in np.nan_to_num(pixels, nan=-1e9).tolist()]
    return np.array(sides) >= 0


def from_middle(solution: Solution, name: str) -> NDArray[np.float64]:
    """Places of all corners of a sensor relative to its principal point (n, 2) [px]."""
    pixels = np.concatenate([view.pixels for view in solution.task.corners if view.sensor == name])
    return pixels - (solution.cameras[name].cx, solution.cameras[name].cy)
