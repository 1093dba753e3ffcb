"""Lenses beyond those of calib are fitted to a tenth of a pixel, or refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calib import pose
from drivers.oak.eeprom import Poses
from drivers.oak.images.heads import cameras
from drivers.oak.images.picture import PictureError, camera
from drivers.oak.roles import ROLES
from tests.drivers.oak.pictures import DEPTH

WIDE = np.array([[560.0, 0, 318], [0, 561, 203], [0, 0, 1]])
PRISM = (1e-3, -5e-4, 8e-4, 2e-4, 0.005, -0.003)
COLOR = replace(DEPTH, type="BGR888i", width=640, height=400, matrix=WIDE, socket=2)


@pytest.mark.parametrize(
    "coefficients",
    [
        (-0.1, 0.05, 1e-3, -5e-4, -0.02, 0, 0, 0, *PRISM),
        (-4.2, 14.1, 4e-4, -7e-4, 2.3, -4.3, 14.2, 2.5, *PRISM),
        (-0.1, 0.05, 1e-3, -5e-4, -0.02, 0, 0, 0, 0, 0, 0, 0, 0.02, -0.01),
        (-0.1, 0.05, 1e-3, -5e-4, -0.02, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    ],
)
def test_thin_prisms_and_tilted_sensors_are_projected_to_a_tenth_of_a_pixel(coefficients: tuple[float, ...]) -> None:
    """Reference: OpenCV's model of 14 coefficients, which is depthai's."""
    made = camera(replace(COLOR, coefficients=coefficients), pose.identity())
    pixels = np.random.default_rng(5).uniform((-0.5, -0.5), (639.5, 399.5), (400, 2))
    full = np.array(coefficients)
    rays = np.insert(cv2.undistortPoints(pixels[:, None], WIDE, full)[:, 0], 2, 1.0, axis=1)
    theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), WIDE, full)[0][:, 0]
    ours = np.array([made.project(ray) for ray in rays])
    assert np.hypot(*(ours - theirs).T).max() < 0.1


def test_lenses_beyond_that_are_rejected_with_the_remedy() -> None:
    with pytest.raises(
        PictureError, match=r"an error of .* px, more than 0.1 px; let the device undistort: undistort=1"
    ):
        camera(replace(COLOR, coefficients=(*[0.1] * 8, 0.1, 0.1, 0.1, 0, 0.1, 0)), pose.identity())


def test_depth_behind_a_tilted_lens_is_rejected() -> None:
    depth = replace(DEPTH, width=640, height=400, matrix=WIDE, coefficients=(0,) * 8 + PRISM)
    with pytest.raises(PictureError, match="tof/depth: depth behind a lens with thin-prism"):
        cameras({ROLES["tof_depth"]: depth}, Poses())
