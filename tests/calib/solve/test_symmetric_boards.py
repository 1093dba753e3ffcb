"""A board that looks the same upside down, numbered from its left end in each image, as detectors do."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.board.views import CornerView
from calib.pose import Pose
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.start.symmetric_boards import numbered_alike
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_views import Head


def from_the_left(view: CornerView) -> CornerView:
    """Numbered so that x points to the right in the image."""
    along, _ = np.polyfit(view.points_b[:, 0], view.pixels[:, 0], 1)
    if along > 0:
        return view
    middle = np.array([(board_views.COLUMNS - 1) * board_views.SQUARE, (board_views.ROWS - 1) * board_views.SQUARE, 0])
    return replace(view, points_b=middle - view.points_b)


def heads(roll: float) -> dict[str, Head]:
    """Two sensors side by side, the second one rolled [rad]."""
    both = board_views.three_heads()
    turned = both["color"].camera.T_rs @ pose.from_rotation_vector((0, 0, roll), np.zeros(3))
    return {
        "light": replace(both["light"], depth_sigma=0.0, camera=replace(both["light"].camera, T_rs=np.eye(4))),
        "color": replace(both["color"], camera=replace(both["color"].camera, T_rs=turned)),
    }


def boards(upright: float, count: int = 16) -> dict[int, Pose]:
    """Boards that are rolled by an angle and some more [rad]."""
    spin = pose.from_rotation_vector((0, 0, upright), np.zeros(3))
    middle = pose.from_rotation_vector(np.zeros(3), board_views.board_points().mean(axis=0))
    turn = middle @ spin @ pose.inverse(middle)
    return {shot: T_rb @ turn for shot, T_rb in board_views.random_boards(count, np.random.default_rng(3)).items()}


def seen_by(rig: dict[str, Head], upright: float) -> Sequence[CornerView]:
    generator = np.random.default_rng(5)
    return [from_the_left(view) for view in board_views.look(rig, boards(upright), generator).corners]


@pytest.mark.parametrize(("roll", "upright"), [(0.0, np.pi / 2), (0.1, np.pi / 2), (np.pi, 0.0), (np.pi / 2, 0.3)])
def test_sensors_that_number_the_board_from_different_ends_are_found(roll: float, upright: float) -> None:
    rig = heads(roll)
    sensors = {name: SensorTask(head.camera.width, head.camera.height) for name, head in rig.items()}
    views = seen_by(rig, upright)
    solution = calibrate(Task(sensors, views, (), "light", two_ways_up=True))
    found = solution.cameras["color"].T_rs
    turn, _ = pose.to_rotation_vector(found @ pose.inverse(rig["color"].camera.T_rs))
    assert np.linalg.norm(turn) < 0.01
    assert np.linalg.norm(found[:3, 3] - rig["color"].camera.T_rs[:3, 3]) < 0.005


def test_views_are_numbered_as_by_the_first_sensor_of_their_shot() -> None:
    rig = heads(np.pi)
    views = seen_by(rig, 0.0)
    alike = numbered_alike(views, {name: head.camera for name, head in rig.items()})
    assert [view.digest for view in alike] == [view.digest for view in views]
    for before, after in zip(views, alike, strict=True):
        turned = bool(np.any(before.points_b != after.points_b))
        assert turned == (
            before.sensor == "color" and any(each.shot == before.shot and each.sensor == "light" for each in views)
        )
    assert numbered_alike(views, {}) == list(views)
