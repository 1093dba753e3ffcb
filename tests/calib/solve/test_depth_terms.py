"""Scale and offset of distances beside poses that are known, or free: what the shots hold, and what they do not."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.solve.bundle.tasks import SensorTask, Task, TaskError
from calib.solve.calibrate import calibrate
from calib.solve.solution import Parameter, Solution
from calib.solve.validation.verdict import assess
from calib.solve.validation.weak_directions import weak_directions
from evaluation.scenes.boards.board_views import Head, look, random_boards, three_heads

SCALE = 0.015


def solved(fixed_pose: bool, terms: tuple[str, ...], near: float = 0.95, far: float = 1.05, **wrong: float) -> Solution:
    """A colour camera and a depth image aligned to it, with known intrinsics, by ten shots of a board."""
    random = np.random.default_rng(5)
    color = three_heads()["color"]
    heads = {"color": color, "depth": Head(color.camera, **{"depth_sigma": 0.004, **wrong})}
    seen = look(heads, random_boards(10, random, near, far), random)
    known = SensorTask(color.camera.width, color.camera.height, factory=(color.camera,), fixed_intrinsics=True)
    depth = replace(known, depth_terms=terms, fixed_pose=fixed_pose)
    return calibrate(Task({"color": known, "depth": depth}, seen.corners, seen.planes, "color"))


def parameter(solution: Solution, name: str) -> Parameter:
    return next(each for each in solution.parameters if each.name == name)


def test_the_scale_of_a_sensor_with_a_known_pose_is_found() -> None:
    solution = solved(True, ("depth_scale",), depth_scale=SCALE)
    found = parameter(solution, "depth.depth_scale")
    assert abs(found.value - SCALE) < 4 * found.sigma < 0.1 * SCALE
    np.testing.assert_array_equal(solution.cameras["depth"].T_rs, solution.cameras["color"].T_rs)
    assert not any(each.name.startswith("depth.") and each is not found for each in solution.parameters)
    assert weak_directions(solution, 1.0) == []


def test_a_scale_that_looks_like_a_position_is_named() -> None:
    solution = solved(False, ("depth_scale",), depth_scale=SCALE, depth_sigma=0.02)
    assert parameter(solution, "depth.depth_scale").sigma > 0.2 * SCALE
    (said,) = weak_directions(solution, 1.0)
    assert said.startswith("depth: the scale of its distances, its position along the view")
    assert "keep a pose that is known (--fixed-pose depth)" in said
    found = assess(solution, 1.0, 1.0)
    assert not found.trusted
    assert said in found.reasons


def test_a_scale_that_is_no_offset_at_one_distance_is_held_by_the_prior_and_named() -> None:
    flat = solved(True, ("depth_offset", "depth_scale"), depth_offset=0.01)
    assert abs(parameter(flat, "depth.depth_offset").value - 0.01) < 4 * parameter(flat, "depth.depth_offset").sigma
    wide = solved(True, ("depth_offset", "depth_scale"), 0.5, 2.0, depth_offset=0.01)
    assert weak_directions(wide, 1.0) == []
    assert parameter(flat, "depth.depth_scale").sigma > 3 * parameter(wide, "depth.depth_scale").sigma


def test_depth_terms_that_nothing_holds_stay_near_zero_with_the_deviation_of_their_prior() -> None:
    """Boards that face the camera at one distance: an offset is a scale, to the last bit of the noise."""
    random = np.random.default_rng(6)
    color = three_heads()["color"]
    boards = random_boards(8, random)
    for number, T_rb in boards.items():  # rolled, so that each is another pose
        T_rb[:3, :3] = pose.from_rotation_vector((0, 0, 0.35 * number), np.zeros(3))[:3, :3]
        T_rb[:3, 3] = (0, 0, 1.0) - T_rb[:3, :3] @ (0.16, 0.12, 0) + random.uniform(-0.02, 0.02, 3) * (1, 1, 0)
    heads = {"color": color, "depth": Head(color.camera, depth_sigma=0.004, depth_offset=0.02)}
    seen = look(heads, boards, random, points=40)
    known = SensorTask(color.camera.width, color.camera.height, factory=(color.camera,), fixed_intrinsics=True)
    depth = replace(known, depth_terms=("depth_offset", "depth_scale"), fixed_pose=True)
    solution = calibrate(Task({"color": known, "depth": depth}, seen.corners, seen.planes, "color"))
    offset, scale = (parameter(solution, f"depth.depth_{name}") for name in ("offset", "scale"))
    assert abs(offset.value + scale.value - 0.02) < 2e-3
    assert 0.01 < scale.sigma < 0.06
    assert weak_directions(solution, 1.0)[0].startswith("depth: the offset of its distances, the scale")


def test_a_pose_cannot_be_kept_that_nobody_knows() -> None:
    camera = three_heads()["color"].camera
    with pytest.raises(TaskError, match="can be kept only where"):
        SensorTask(camera.width, camera.height, fixed_pose=True)
    known = SensorTask(camera.width, camera.height, factory=(camera,), fixed_pose=True)
    with pytest.raises(TaskError, match="only with one of the reference, color"):
        Task({"color": replace(known, factory=(), fixed_pose=False), "depth": known}, (), (), "color")
