"""Kept intrinsics are doubted if the sensor's own images contradict them."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.calibration_check.kept_intrinsics import with_kept
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views

CAMERA = replace(board_views.three_heads()["color"].camera, T_rs=np.eye(4))


@pytest.mark.parametrize(("zoom", "trusted"), [(1.0, True), (1.001, True), (1.01, False), (0.99, False)])
def test_kept_intrinsics_that_the_images_contradict_are_not_trusted(zoom, trusted):
    generator = np.random.default_rng(2)
    right = replace(CAMERA, T_rs=pose.from_rotation_vector((0, -0.05, 0), (0.1, 0, 0)))
    heads = {"left": board_views.Head(CAMERA, 0.1), "right": board_views.Head(right, 0.1)}
    seen = board_views.look(heads, board_views.random_boards(16, generator), generator).corners
    given = replace(CAMERA, fx=zoom * CAMERA.fx, fy=zoom * CAMERA.fy)
    kept = {name: SensorTask(1280, 720, factory=(given,), fixed_intrinsics=True) for name in heads}
    solution = calibrate(Task(kept, seen, (), "left"))
    taken = assess(solution, 1.0, 1.0)
    assert taken.trusted, "residuals alone do not tell"
    found = with_kept(taken, solution, 1.0)
    assert found.trusted == trusted, found.verdict
    if not trusted:
        said, _, values = found.verdict.partition(" a focal length ")
        assert said.startswith("Do not trust it yet: left: its images contradict the intrinsics that are kept:")
        assert float(values.partition("%")[0]) == pytest.approx(100 * (1 / zoom - 1), abs=0.25)
        assert [reason.partition(":")[0] for reason in found.reasons] == ["left", "right"]


def test_intrinsics_that_were_solved_are_not_concerned():
    generator = np.random.default_rng(2)
    seen = board_views.look(
        {"color": board_views.Head(CAMERA, 0.1)}, board_views.random_boards(12, generator), generator
    ).corners
    solution = calibrate(Task({"color": SensorTask(1280, 720)}, seen, (), "color"))
    taken = assess(solution, 1.0, 1.0)
    assert with_kept(taken, solution, 1.0) is taken
