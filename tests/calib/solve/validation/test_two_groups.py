"""Two groups of shots that contradict each other: each shot is found; the smaller group is named, or both."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib import pose
from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.regrouping.initial_groups import by_residuals
from calib.solve.regrouping.two_groups import TwoGroups, numbered, two_groups, unexplained
from calib.solve.solution import Solution
from calib.solve.validation.free_shape import free_shape
from calib.solve.validation.inconsistent_shots.contradictions import completed, contradictions
from calib.solve.validation.inconsistent_shots.findings import inconsistent_shots
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views
from tests.calib.solve.validation.test_contradictions import BOARDS, moved, solved

FEW, HALF = (2, 3, 7, 11, 16), (0, 2, 3, 5, 7, 11, 12, 14, 16, 19)


@cache
def bumped(shots: tuple[int, ...], by: float = 0.006) -> Solution:
    """The colour camera stands elsewhere in these shots."""
    return solved({shot: moved(T_rb, (by, 0, 0)) if shot in shots else T_rb for shot, T_rb in BOARDS.items()})


def reasons(solution: Solution) -> list[str]:
    return [*inconsistent_shots(free_shape(solution), [], 1.0).reasons]


@pytest.mark.parametrize("shots", [FEW, HALF])
def test_each_shot_goes_to_its_group(shots: tuple[int, ...]) -> None:
    solution = bumped(shots)
    wrong_guess = {*shots[2:], *(each + 1 for each in shots[2:])} & {*BOARDS}
    for guess in (by_residuals(solution), wrong_guess):
        (found,) = two_groups(solution.task, solution.cameras, [guess])
        assert {*shots} in ({*found.smaller}, {*found.larger})
        assert found.alone_px < 0.3 < found.other_px


def test_the_smaller_group_is_named() -> None:
    (said,) = reasons(bumped(FEW))
    assert said.startswith("two groups of shots contradict each other: 2-3,7,11,16 and 0-1,4-6")
    assert said.endswith("leave one out: --skip 2-3,7,11,16")


def test_of_equal_groups_none_is_called_the_wrong_one() -> None:
    (said,) = reasons(bumped(HALF))
    assert "One of both groups is wrong, and nothing says which" in said
    assert f"--skip {numbered(HALF)}" in said
    assert f"--skip {numbered({*BOARDS} - {*HALF})}" in said


def test_shots_that_scatter_are_not_two_groups_that_differ_by_chance() -> None:
    random = np.random.default_rng(5)
    (said,) = reasons(
        solved({shot: moved(T_rb, tuple(0.0004 * random.standard_t(2, 3))) for shot, T_rb in BOARDS.items()})
    )
    assert said.startswith("one shot contradicts the others: shot 4: corners of light miss by 1.4 px")


def test_halves_that_agree_about_each_sensor_do_not_doubt_its_lens() -> None:
    _, said = assess(bumped((0, 4, 8, 12, 16), 0.001), 1.0, 1.0).reasons
    assert said.startswith("light → color: the halves of the shots differ by ")
    assert "and agree about each of the two: the images of a shot were not taken at the same moment" in said
    assert "kind of lens" not in said


def test_groups_that_have_no_minimum_together_are_told_from_the_start() -> None:
    with pytest.raises(NotSolvedError, match=r"Two groups of shots contradict each other: .* or --skip "):
        bumped(HALF, 0.2)


def test_shots_of_one_rig_are_not_two_groups() -> None:
    solution = bumped(())
    found = two_groups(solution.task, solution.cameras, [HALF])
    assert all(one.other_px < 1.2 * one.alone_px for one in found)
    assert reasons(solution) == []


def test_a_shot_that_others_hid_is_named_with_them() -> None:
    random = np.random.default_rng(3)
    wrong = {shot: moved(BOARDS[shot], tuple(random.normal(0, 0.03, 3))) for shot in (4, 9, 15)}
    solution = solved({**BOARDS, **wrong})
    found = contradictions(solution)
    assert {one.shot for one in completed(solution, found[:1])} == {4, 9, 15}
    assert {*unexplained(solution.task, solution.cameras, {4, 9})} == {4, 9, 15}


def test_shots_are_written_as_skip_reads_them() -> None:
    assert numbered({9, 3, 8, 7, 12}) == "3,7-9,12"
    assert TwoGroups((1, 2), (0, 3, 4, 5), 0.1, 2.0).advice.endswith("--skip 1-2")


def exchanged(shots: tuple[int, ...]) -> Task:
    """Two cameras side by side, whose files were exchanged in these shots."""
    camera = board_views.three_heads()["color"].camera
    beside = camera.T_rs @ pose.from_rotation_vector((0, 0.06, 0), (0.1, 0, 0))
    heads = {
        "left": board_views.Head(replace(camera, T_rs=pose.identity()), 0.1),
        "right": board_views.Head(replace(camera, fx=camera.fx * 0.99, T_rs=beside), 0.1),
    }
    generator, other = np.random.default_rng(1), {"left": "right", "right": "left"}
    seen = board_views.look(heads, board_views.random_boards(20, generator), generator).corners
    views = [replace(view, sensor=other[view.sensor]) if view.shot in shots else view for view in seen]
    sensors = {name: SensorTask(camera.width, camera.height) for name in heads}
    return Task(sensors, views, (), "left")


@pytest.mark.parametrize("shots", [FEW, HALF[:9]])
def test_images_that_were_exchanged_in_some_shots_are_named(shots: tuple[int, ...]) -> None:
    """That a sensor was moved, or that images are paired otherwise, led nobody to two exchanged files."""
    with pytest.raises(NotSolvedError, match=f"images of left and right were exchanged .* shots {numbered(shots)}, "):
        calibrate(exchanged(shots))


def test_a_sensor_that_moved_has_no_exchanged_images() -> None:
    solution = bumped(FEW)
    (found,) = two_groups(solution.task, solution.cameras, [FEW])
    assert found.exchanged == ()
