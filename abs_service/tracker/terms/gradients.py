"""Derivatives of residuals by vertex positions, from which the curvature of the objective is built."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

#: Half the side of the neighbourhood whose colours give the image's slope at a vertex [px].
RADIUS_PX = 2

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
    points = np.asarray(vertices, np.float64)
    step = 1e-4
    offsets = np.concatenate([np.eye(3), -np.eye(3)]) * step
    moved = camera.project(points[:, None] + offsets)
    projection = (moved[:, :3] - moved[:, 3:]).transpose(0, 2, 1) / (2 * step)
    return _image_gradient(image, np.floor(camera.project(points) + 0.5).astype(int)) @ projection


def _image_gradient(image: NDArray[np.float32], pixels: NDArray[np.integer]) -> NDArray[np.float64]:
    """Derivatives (n, 3 channels, 2) of an image by column and row at pixels (n, 2), over a Gaussian neighbourhood.

    Only the vertices' pixels are smoothed; a colour image has a thousand times as many.
    """
    steps = np.arange(-RADIUS_PX, RADIUS_PX + 1)
    column = np.clip(pixels[:, :1] + steps, 0, image.shape[1] - 1)
    row = np.clip(pixels[:, 1:] + steps, 0, image.shape[0] - 1)
    patches = image[row[:, :, None], column[:, None, :]].astype(np.float64)
    bell = np.exp(-0.5 * steps**2)
    weights = np.outer(bell, steps * bell) / (bell.sum() * (steps**2 * bell).sum())
    return np.einsum("nrkc,rkd->ncd", patches, np.stack([weights, weights.T], axis=-1))
