"""Signs that a calibration was misread, or its images exchanged."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.camera import Camera
from calib.formats.plausibility import baselines, exchanged

CAMERA = Camera(640, 480, 530.0, 530.0, 320.0, 240.0)


def at(*place: float, turn: float = 0.0) -> Camera:
    """A camera at a place [m], turned about the vertical [rad]."""
    return replace(CAMERA, T_rs=pose.from_rotation_vector((0, turn, 0), place))


@pytest.mark.parametrize(
    ("place", "side"),
    [
        ((0.08, 0.01, 0.0), "to the right of"),
        ((-0.08, 0.01, 0.0), "to the left of"),
        ((0.0, -0.05, 0.02), "above"),
        ((0.0, 0.05, 0.02), "below"),
        ((0.0, 0.0, -0.02), "behind"),
        ((0.0, 0.0, 0.02), "in front of"),
    ],
)
def test_a_baseline_says_on_which_side_the_second_camera_stands(place: tuple[float, ...], side: str) -> None:
    (found,) = baselines({"a": at(0, 0, 0), "b": at(*place)}).values()
    assert (found.length, found.side) == (pytest.approx(np.linalg.norm(place)), side)


def test_left_and_right_that_stand_the_other_way_round_are_named() -> None:
    (said,) = exchanged({"infra_left": at(0.08, 0, 0), "infra_right": at(0, 0, 0)})
    assert said.startswith("infra_right stands 80.0 mm to the left of infra_left, as they see it: are their names exch")
    assert not exchanged({"left": at(0, 0, 0), "right": at(0.08, 0, 0)})
    assert not exchanged({"left": at(0.08, 0, 0), "other": at(0, 0, 0)})


def test_cameras_that_look_at_each_other_may_stand_either_way() -> None:
    assert not exchanged({"left": at(0, 0, 0), "right": at(-0.8, 0, 1.0, turn=np.pi)})
