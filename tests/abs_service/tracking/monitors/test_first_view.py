"""The first image tells a side of the object, which it hid, from what was not there."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh
from abs_service.tracking.monitors.first_view import FirstView
from calib import pose
from calib.camera import Camera
from evaluation.scenes.solids import Plane, image

CAMERA = Camera(160, 120, fx=150, fy=150, cx=79.5, cy=59.5)
FRONT = Plane(np.array([0.0, 0.0, 1.0]), 0.9, (-0.15, 0.15, -0.1, 0.1))
WALL = Plane(np.array([0.0, 0.0, 1.0]), 1.8)
SEEN = image(CAMERA, (FRONT,)).astype(np.float32)
DETECTION = InitialDetection(SEEN, CAMERA, 260, image(CAMERA, (FRONT, WALL)).astype(np.float32))
MESH = grid_mesh(DETECTION)
#: Where the box is later.
MOVED = pose.from_rotation_vector((0.6, 0.1, 0.0), (0.05, -0.4, 0.2))
SIDE = np.linspace(-0.15, 0.15, 20)


def part(y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Points (20 k, 3) [m] at x along the box's width and at (y, z)."""
    x, k = np.meshgrid(SIDE, np.arange(len(y)))
    return np.stack([x, y[k], z[k]], axis=-1).reshape(-1, 3)


TOP = part(np.full(8, -0.1), np.linspace(0.9, 1.1, 8))
LID = part(np.linspace(-0.3, -0.1, 8), np.full(8, 0.9))


def found(*parts: np.ndarray) -> Mesh:
    """A mesh of the front and further parts, later."""
    return replace(MESH, vertices=pose.transform(MOVED, np.concatenate([MESH.vertices, *parts])))


@pytest.mark.parametrize(
    ("parts", "hidden"),
    [((), True), ((TOP,), True), ((LID,), False), ((TOP, LID), False)],
    ids=["front", "top", "lid", "top and lid"],
)
def test_a_side_that_was_behind_the_object_is_told_from_what_touches_it(parts, hidden):
    now = pose.transform(MOVED, MESH.vertices)
    assert FirstView(DETECTION, MESH).hid(found(*parts), now) == hidden


def test_of_an_object_that_bends_or_of_an_unknown_scene_nothing_is_said():
    bent = pose.transform(MOVED, MESH.vertices + np.outer(2 * MESH.vertices[:, 0] ** 2, (0, 0, 1)))
    assert not FirstView(DETECTION, MESH).hid(found(TOP), bent)
    alone = InitialDetection(SEEN, CAMERA, 260)
    assert not FirstView(alone, MESH).hid(found(TOP), pose.transform(MOVED, MESH.vertices))
