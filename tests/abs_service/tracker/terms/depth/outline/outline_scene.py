"""A sheet before a wall, and its outline in a depth image."""

import numpy as np

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.terms.depth.classification.visibility import classify, surfaces_of
from abs_service.tracker.terms.depth.outline.observed_outline import ObservedRimOutline
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from calib.camera import Camera
from tests.abs_service.tracker.scenes import as_surface, flat, sheet, sparse

CAMERA = Camera(120, 90, 200.0, 200.0, 59.3, 44.2)
MESH = sheet(13, 19, flat)
BESIDE_M = 1.6


def picture(mesh: Mesh = MESH, by: float = 0.0) -> np.ndarray:
    """A flat sheet as large as the mesh, moved to the right, before a wall [m]."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    (left, top), (right, bottom) = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
    on = (x > left + by) & (x < right + by) & (y > top) & (y < bottom)
    return (np.where(on, 1.0, BESIDE_M) / rays[..., 2]).astype(np.float32)


def moved(mesh: Mesh, x: float, y: float = 0.0) -> Surface:
    return as_surface((mesh.vertices + np.array([x, y, 0.0]), mesh.normals))


def begun(distance: np.ndarray, mesh: Mesh = MESH) -> RimOutline:
    """The outline of a mesh after its first image."""
    result = RimOutline(CAMERA, Rim.of(mesh), 0.5)
    look(result, distance, mesh)
    return result


def outline(distance: np.ndarray, mesh: Mesh = MESH) -> ObservedRimOutline:
    """The outline of a mesh in its first image."""
    return look(RimOutline(CAMERA, Rim.of(mesh), 0.5), distance, mesh)


def look(at: RimOutline, distance: np.ndarray, mesh: Mesh = MESH) -> ObservedRimOutline:
    """The outline in the next image, where the mesh has not moved."""
    view = sparse(CAMERA, mesh).view("tof", np.zeros((len(mesh.vertices), 0), np.float32))
    predicted = moved(mesh, 0.0)
    expected = view.render(predicted)
    return at.observe(distance, classify(surfaces_of(distance), expected, CAMERA.fx), expected, predicted)
