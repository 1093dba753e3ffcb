"""Round outlines: they do not show how far the object has turned in its plane.

An edge tells where it is across the outline only, which a turn of a disc does not change. But the gradients of
distances from an outline of pixels are up to 20° off its normal, and the squares of these errors would hold the turn to
a millimetre.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.depth.outline.rim import read
from abs_service.tracker.terms.sensor_fit import MIN_RIM
from calib.camera import Camera

#: An outline is round if the squared cosine between its normals and a turn is smaller, on average. That of an ellipse
#: with axes of 0.85 to 1 is as large, of a hexagon 0.09; pixels alone make 0.002, and 0.006 if noise frays them.
MAX_COSINE_SQUARED = 0.01

#: Standard deviation of the window in which normals of the outline are found [px].
SMOOTH_PX = 1.5


def is_round(
    camera: Camera, points: NDArray[np.float64], inwards: NDArray[np.float32], corner: NDArray[np.float32]
) -> bool:
    """True if a turn of edges in their plane moves them along the outline.

    Args:
        camera: the depth camera.
        points: the free edges (k, 3) [m].
        inwards: distances inside the outline (rows, columns) [px], NaN where unknown.
        corner: column and row of their first pixel (2,).
    """
    if len(points) < MIN_RIM:
        return False
    places, by_place = project_with_jacobian(camera, points)
    down, right = np.gradient(cv2.GaussianBlur(inwards, (0, 0), SMOOTH_PX))
    slopes = np.stack([read(image, corner, places, (camera.width, camera.height)) for image in (right, down)])
    known = np.isfinite(slopes).all(axis=0)
    normals = slopes[:, known].T / np.maximum(np.linalg.norm(slopes[:, known], axis=0), np.finfo(float).tiny)[:, None]
    cosine = np.vecdot(normals, _turn(points, by_place)[known])
    return len(cosine) >= MIN_RIM and float(np.mean(cosine**2)) < MAX_COSINE_SQUARED


def without_turn(
    gradients: NDArray[np.float64], by_place: NDArray[np.float64], points: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Image gradients (k, 2) of edges, without their component that a rotation of the edges in their plane would cause.

    Args:
        gradients: of the distances of the edges (k, 2).
        by_place: derivatives of their places in the image (k, 2, 3) [px/m].
        points: the edges (k, 3) [m].
    """
    along = _turn(points, by_place)
    return gradients - np.vecdot(gradients, along)[:, None] * along


def _turn(points: NDArray[np.floating], by_place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions in the image (k, 2) into which a turn in their plane, about their centre, moves edges (k, 3)."""
    arms = points - points.mean(axis=0)
    normal = np.linalg.eigh(arms.T @ arms)[1][:, 0]
    along = (by_place @ np.cross(normal, arms)[..., None])[..., 0]
    return np.asarray(along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny))
