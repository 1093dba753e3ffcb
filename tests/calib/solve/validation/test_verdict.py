"""The verdict says where and how well a camera is known: a camera that is hardly known is not trusted."""

from dataclasses import replace

import numpy as np

from calib import pose
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.validation.verdict import Assessment, assess
from evaluation.scenes.boards import board_views

CAMERA = replace(board_views.three_heads()["color"].camera, T_rs=np.eye(4))


def judged(places: float, tilt: float, distance: float) -> Assessment:
    """Boards up to `places` times the distance [m] off the axis, tilted by up to `tilt` [rad]; 10 px are enough."""
    generator = np.random.default_rng(2)
    boards = {}
    for shot in range(12):
        turn = pose.from_rotation_vector((*generator.uniform(-tilt, tilt, 2), 0.3 * (shot % 3)), np.zeros(3))
        z = distance * generator.uniform(0.9, 1.1)
        middle = turn[:3, :3] @ board_views.board_points().mean(axis=0)
        turn[:3, 3] = (*generator.uniform(-places, places, 2) * (z, 0.5 * z), z) - middle
        boards[shot] = turn
    seen = board_views.look({"color": board_views.Head(CAMERA, 0.1)}, boards, generator).corners
    return assess(calibrate(Task({"color": SensorTask(1280, 720)}, seen, (), "color")), distance, 10.0)


def test_trust_says_in_how_much_of_the_image_boards_were_seen() -> None:
    found = judged(places=0.4, tilt=0.6, distance=1.0)
    assert found.trusted
    assert "px (95 %) where boards were seen, in " in found.verdict


def test_a_focal_length_that_boards_without_tilt_do_not_hold_is_not_trusted() -> None:
    found = judged(places=0.3, tilt=0.03, distance=1.0)
    assert any(reason.startswith("color: its focal length is known to ± ") for reason in found.reasons)


def test_a_camera_that_saw_the_board_in_a_small_part_of_its_image_is_not_trusted() -> None:
    found = judged(places=0.02, tilt=0.7, distance=1.9)
    (reason,) = (reason for reason in found.reasons if "the board was seen in " in reason)
    assert reason.startswith("color: the board was seen in ")


def test_a_right_camera_that_stands_to_the_left_of_the_left_one_is_not_trusted() -> None:
    generator = np.random.default_rng(2)
    right = replace(CAMERA, T_rs=pose.from_rotation_vector((0, -0.05, 0), (0.1, 0, 0)))
    heads = {"left": board_views.Head(CAMERA, 0.1), "right": board_views.Head(right, 0.1)}
    seen = board_views.look(heads, board_views.random_boards(16, generator), generator).corners
    other = {"left": "right", "right": "left"}
    for corners, trusted in ((seen, True), ([replace(view, sensor=other[view.sensor]) for view in seen], False)):
        solution = calibrate(Task({name: SensorTask(1280, 720) for name in heads}, corners, (), "left"))
        found = assess(solution, 1.0, 10.0)
        assert found.trusted == trusted, found.verdict
    assert found.verdict.startswith("Do not trust it yet: right stands 100.")


def test_trust_says_which_intrinsics_were_taken_as_given() -> None:
    generator = np.random.default_rng(2)
    right = replace(CAMERA, T_rs=pose.from_rotation_vector((0, -0.05, 0), (0.1, 0, 0)))
    heads = {"left": board_views.Head(CAMERA, 0.1), "right": board_views.Head(right, 0.1)}
    seen = board_views.look(heads, board_views.random_boards(12, generator), generator).corners
    kept = {name: SensorTask(1280, 720, factory=(CAMERA,), fixed_intrinsics=True) for name in heads}
    found = assess(calibrate(Task(kept, seen, (), "left")), 1.0, 10.0)
    assert found.trusted, found.verdict
    assert found.verdict.endswith(" That takes the intrinsics of left and right as given.")
