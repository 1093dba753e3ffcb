"""Residuals between a tracked mesh and a depth image, in both directions."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from calib.camera import Camera

#: Triangles are sampled this many times along each side for point-to-surface distances.
SUBDIVISIONS = 8


@dataclass(frozen=True)
class Agreement:
    """One frame.

    Attributes:
        forward_mm: median |synthesised − measured distance| over the vertices inside the mask [mm].
        backward_mm: median distance of the measured points inside the mask from the mesh [mm].
        inside: share of the vertices that project into the mask.
        covered: share of the mask that the projected mesh covers.
    """

    forward_mm: float
    backward_mm: float
    inside: float
    covered: float


def agreement(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    distance: NDArray[np.float32],
    mask: NDArray[np.bool_],
    camera: Camera,
) -> Agreement:
    """Compares a mesh with one depth image.

    Args:
        vertices, faces: the mesh (n, 3) [m] and (m, 3) in rig coordinates.
        distance: measured radial distances (height, width) [m], NaN without return.
        mask: the object's pixels (height, width).
        camera: the camera that measured.
    """
    error, inside = vertex_errors(vertices, distance, mask, camera)
    points = camera.unproject(distance)[mask & np.isfinite(distance)]
    to_mesh = KDTree(_sampled(np.asarray(vertices, float), faces)).query(points)[0]
    return Agreement(
        forward_mm=float(np.nanmedian(np.abs(error[inside])) * 1e3),
        backward_mm=float(np.median(to_mesh) * 1e3),
        inside=float(inside.mean()),
        covered=float((_silhouette(vertices, faces, camera)[mask] > 0).mean()),
    )


def vertex_errors(
    vertices: NDArray[np.floating], distance: NDArray[np.float32], mask: NDArray[np.bool_], camera: Camera
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Synthesised − measured distance (n,) [m] of every vertex, NaN where unknown; whether it is inside the mask."""
    column, row = np.floor(camera.project(vertices) + 0.5).astype(int).T
    seen = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    error, inside = np.full(len(vertices), np.nan), np.zeros(len(vertices), bool)
    error[seen] = camera.distance(vertices[seen]) - distance[row[seen], column[seen]]
    inside[seen] = mask[row[seen], column[seen]]
    return error, inside


def _sampled(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> NDArray[np.float64]:
    steps = [(i, j) for i in range(SUBDIVISIONS + 1) for j in range(SUBDIVISIONS + 1 - i)]
    weights = np.array([(i, j, SUBDIVISIONS - i - j) for i, j in steps]) / SUBDIVISIONS
    return np.einsum("bk,fkd->fbd", weights, vertices[faces]).reshape(-1, 3)


def _silhouette(vertices: NDArray[np.floating], faces: NDArray[np.integer], camera: Camera) -> NDArray[np.uint8]:
    image = np.zeros((camera.height, camera.width), np.uint8)
    for triangle in np.round(camera.project(vertices)[faces]).astype(np.int32):
        cv2.fillConvexPoly(image, triangle, 1)
    return image
