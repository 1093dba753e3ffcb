"""Cameras of images of another size, and poses that are rounded."""

import numpy as np
import pytest

from calib import pose
from calib.camera import Camera
from calib.formats.content import FormatError, rigid
from calib.formats.resizing import resized


def test_an_image_of_another_size_shows_the_same_directions() -> None:
    """Each coarse pixel lies in the middle of the fine ones that it is made of."""
    camera = Camera(1280, 800, 800.0, 801.0, 641.0, 399.0)
    half = resized(camera, 640, 360)  # scaled by a half, then 20 rows cropped above and below
    fine = camera.directions(np.array([[100.0, 240.0], [101.0, 241.0]])).mean(axis=0)
    np.testing.assert_allclose(half.directions(np.array([50.0, 100.0])), fine / np.linalg.norm(fine), atol=1e-6)


def test_a_rounded_rotation_is_made_orthonormal_and_a_wrong_one_refused() -> None:
    T = pose.from_rotation_vector((0.1, 0.2, 0.3), (1, 2, 3))
    assert pose.is_pose(rigid(np.round(T, 5)), 1e-12)
    for wrong in (2 * T, np.diag([1, 1, -1, 1]), np.full((4, 4), np.nan), np.eye(3)):
        with pytest.raises(FormatError):
            rigid(wrong)
