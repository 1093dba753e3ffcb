"""Poses of an OAK's heads: of the views that its images show, rectified and aligned."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from drivers.oak.eeprom import EepromError, Extrinsics, Poses
from drivers.oak.images.heads import cameras
from drivers.oak.roles import ROLES
from tests.drivers.oak.pictures import DEPTH


def test_stereo_images_have_rectified_poses() -> None:
    """The rectified cameras are parallel, with the right one on the x axis of the left one."""
    R1 = pose.from_rotation_vector([0, 0.02, 0.01], [0, 0, 0])
    T_rect_left_right = pose.from_rotation_vector([0, 0, 0], [0.075, 0, 0])
    R2 = pose.from_rotation_vector([0.01, -0.01, 0], [0, 0, 0])
    T_left_right = pose.inverse(R1) @ T_rect_left_right @ R2
    poses = Poses({1: Extrinsics(-1, pose.identity()), 2: Extrinsics(1, T_left_right)}, {1: R1, 2: R2})
    gray = replace(DEPTH, type="GRAY8", stride=8, socket=1)
    found = cameras(
        {ROLES["depth"]: replace(DEPTH, socket=1), ROLES["left"]: gray, ROLES["right"]: replace(gray, socket=2)}, poses
    )
    assert set(found) == {"depth", "right"}
    np.testing.assert_allclose(found["right"].T_rs, T_rect_left_right, atol=1e-12)


TURN = pose.from_rotation_vector([0.01, -0.02, 0.005], [0, 0, 0])
T_LEFT_RIGHT = pose.from_rotation_vector([0.004, 0.01, -0.003], [0.075, 0.001, -0.002])
T_COLOR_LEFT = pose.from_rotation_vector([0.003, 0, 0.002], [0.0375, 0, 0])
#: Sockets: left 1, right 2, colour 0, which is the root.
EXTRINSICS = {0: Extrinsics(-1, pose.identity()), 1: Extrinsics(0, T_COLOR_LEFT), 2: Extrinsics(1, T_LEFT_RIGHT)}
GRAY = replace(DEPTH, type="GRAY8", stride=8)


def test_the_pose_of_aligned_depth_is_that_of_its_view_and_not_of_the_camera_whose_number_it_has() -> None:
    """Depth is computed from the right camera's image, whose number it may have, and aligned to the left one's."""
    poses = Poses(EXTRINSICS, {1: TURN, 2: TURN}, (1, 2))
    T_color_view = T_COLOR_LEFT @ pose.inverse(TURN)
    depth = replace(DEPTH, socket=2, extrinsics=Extrinsics(0, T_color_view))
    found = cameras({ROLES["depth"]: depth, ROLES["color"]: replace(GRAY, socket=0)}, poses)
    np.testing.assert_allclose(found["color"].T_rs, pose.inverse(T_color_view), atol=1e-12)


def test_rectification_is_computed_where_the_device_stores_none() -> None:
    """The rectified cameras are parallel, with the right one on the x axis of the left one, at its distance."""
    left, right, color = (replace(GRAY, socket=socket) for socket in (1, 2, 0))
    pictures = {ROLES["depth"]: replace(DEPTH, socket=1), ROLES["left"]: left, ROLES["right"]: right}
    found = cameras({**pictures, ROLES["color"]: color}, Poses(EXTRINSICS, {}, (1, 2)))
    expected = pose.from_rotation_vector([0, 0, 0], [float(np.linalg.norm(T_LEFT_RIGHT[:3, 3])), 0.0, 0.0])
    np.testing.assert_allclose(found["right"].T_rs, expected, atol=1e-9)
    # Half of the turn between the cameras is the left one's, so the colour camera is turned by a few hundredths.
    assert np.linalg.norm(pose.to_rotation_vector(found["color"].T_rs)[0]) < 0.05
    distance = np.linalg.norm(found["color"].T_rs[:3, 3])
    assert distance == pytest.approx(np.linalg.norm(T_COLOR_LEFT[:3, 3]))
    with pytest.raises(EepromError, match="camera 1 is none of the stereo pair"):
        cameras({**pictures, ROLES["color"]: color}, Poses(EXTRINSICS))


def test_unconnected_and_circular_extrinsics_are_rejected() -> None:
    with pytest.raises(EepromError, match="nothing is known of where camera 1 is relative to camera 0"):
        Poses({}).between(0, 1)
    circle = Poses({0: Extrinsics(1, pose.identity()), 1: Extrinsics(0, pose.identity())})
    with pytest.raises(EepromError, match="circle"):
        circle.between(0, 1)
