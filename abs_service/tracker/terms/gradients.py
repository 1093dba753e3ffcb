"""Derivatives of residuals by vertex positions, from which the curvature of the objective is built."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

#: Grazing views: the cosine between line of sight and normal below which a row would explode.
LEAST_COSINE = 0.2


def depth_rows(
    vertices: NDArray[np.floating], normals: NDArray[np.floating], center: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivatives (n, 3) of measured − synthesised distance by the vertex.

    A vertex that slides along the surface keeps its residual, because the measurement moves with the pixel; only its
    motion along the normal counts, lengthened by the angle between normal and line of sight.

    Args:
        vertices, normals: positions [m] and unit normals (n, 3).
        center: camera centre c_s (3,) [m].
    """
    sight = np.asarray(vertices, np.float64) - center
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    cosine = np.einsum("ni,ni->n", normals, sight)
    return -normals / np.minimum(cosine, -LEAST_COSINE)[:, None]


def color_rows(image: NDArray[np.float32], camera: Camera, vertices: NDArray[np.floating]) -> NDArray[np.float64]:
    """Derivatives (n, 3 channels, 3) of the measured colour at a vertex's pixel by the vertex, in levels per metre.

    Args:
        image: colour image (height, width, 3), 0…255.
        camera: its camera.
        vertices: positions (n, 3) [m].
    """
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
    gradient = np.stack([cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)], axis=-1) / 8
    points = np.asarray(vertices, np.float64)
    step = 1e-4
    offsets = np.concatenate([np.eye(3), -np.eye(3)]) * step
    moved = camera.project(points[:, None] + offsets)
    projection = (moved[:, :3] - moved[:, 3:]).transpose(0, 2, 1) / (2 * step)
    place = np.floor(camera.project(points) + 0.5).astype(int)
    column, row = np.clip(place[:, 0], 0, camera.width - 1), np.clip(place[:, 1], 0, camera.height - 1)
    return gradient[row, column].astype(np.float64) @ projection
