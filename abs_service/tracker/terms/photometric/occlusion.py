"""Occluders measured by one sensor, projected into the image of a sensor that measures no distances."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera


def occluded_pixels(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels (height, width) of a camera that points (k, 3) [m], neighbours in another sensor's image, cover.

    Each covers a square as wide as the gap to its neighbour, so that the mask has no holes.
    """
    covered = np.zeros((camera.height, camera.width), np.uint8)
    seen = points[camera.in_field(points)]
    pixel = np.floor(camera.project(seen) + 0.5)
    inside = np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=1)
    column, row = pixel[inside].astype(int).T
    if not len(row):
        return covered > 0
    covered[row, column] = 1
    gap_m = float(np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))) if len(points) > 1 else 0.0
    depth_m = float(np.median((seen - camera.center) @ camera.T_rs[:3, 2]))
    side = 2 * int(np.ceil(gap_m * camera.fx / depth_m / 2)) + 1
    return cv2.dilate(covered, np.ones((side, side), np.uint8)) > 0
