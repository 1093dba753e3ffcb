"""Shots that contradict the rest are named, and images of different moments are told from a bad lens."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.board.views import CornerView
from calib.pose import Pose
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.diagnoses import unlike_the_rest
from calib.solve.solution import Solution
from calib.solve.start.extrinsics_graph import ContradictionError
from calib.solve.start.start import start
from calib.solve.validation.inconsistent_shots.contradictions import contradictions
from calib.solve.validation.inconsistent_shots.scatter import scatter
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_views import Head

HEADS = {name: head for name, head in board_views.three_heads().items() if name != "tof"}
BOARDS = board_views.random_boards(20, np.random.default_rng(5))


def views(second: Mapping[int, Pose], heads: Mapping[str, Head] = HEADS) -> list[CornerView]:
    """Corners of both heads; the colour camera sees the `second` boards."""
    random = np.random.default_rng(5)
    light = board_views.look({"light": heads["light"]}, BOARDS, random)
    return [*light.corners, *board_views.look({"color": heads["color"]}, second, random).corners]


def task(second: Mapping[int, Pose], heads: Mapping[str, Head] = HEADS) -> Task:
    sensors = {name: SensorTask(head.camera.width, head.camera.height) for name, head in heads.items()}
    return Task(sensors, views(second, heads), (), "light")


def solved(second: Mapping[int, Pose]) -> Solution:
    return calibrate(task(second))


def moved(T_rb: Pose, by: tuple[float, ...]) -> Pose:
    return pose.from_rotation_vector((0, 0, 0), by) @ T_rb


def test_a_rig_whose_shots_agree_has_none() -> None:
    solution = solved(BOARDS)
    assert contradictions(solution) == []
    assert scatter(solution) == []


def test_a_board_that_moved_between_the_images_of_a_shot_is_named_and_not_trusted() -> None:
    solution = solved({**BOARDS, 7: moved(BOARDS[7], (0.02, 0, 0))})
    (found,) = contradictions(solution)
    assert (found.shot, set(found.sensors)) == (7, {"light", "color"})
    assert found.apart == pytest.approx(0.02, abs=0.003)
    assessment = assess(solution, 1.0, 1.0)
    assert not assessment.trusted
    assert "one shot contradicts the others: shot 7: corners of" in assessment.verdict
    assert assessment.verdict.endswith("--skip 7")


def test_images_that_were_exchanged_are_named_with_their_place() -> None:
    found = contradictions(solved({**BOARDS, 4: BOARDS[9], 9: BOARDS[4]}))
    assert {one.shot: one.exchanged_with for one in found} == {4: (9,), 9: (4,)}


def test_images_of_different_moments_are_told_from_everything_else() -> None:
    random = np.random.default_rng(6)
    solution = solved({shot: moved(T_rb, tuple(random.normal(0, 0.006, 3))) for shot, T_rb in BOARDS.items()})
    (found,) = scatter(solution)
    assert found.alone_px < 0.3 < 3 * found.alone_px < found.apart_px
    verdict = assess(solution, 1.0, 1.0).verdict
    assert verdict.startswith("Do not trust it yet: light and color: each fits its own corners")
    assert "were not taken at the same moment" in verdict


def test_different_moments_are_the_cause_of_what_else_is_wrong_where_they_are_small() -> None:
    random = np.random.default_rng(6)
    later = {shot: moved(T_rb, tuple(random.normal(0, 0.0005, 3))) for shot, T_rb in BOARDS.items()}
    solution = calibrate(task(later, {name: replace(head, corner_sigma=0.02) for name, head in HEADS.items()}))
    assert scatter(solution) == []
    first, *others = assess(solution, 1.0, 1.0).reasons
    assert "were not taken at the same moment" in first
    assert others


def test_shots_that_another_kind_of_lens_explains_do_not_contradict() -> None:
    solution = solved({**BOARDS, 7: moved(BOARDS[7], (0.02, 0, 0))})
    (found,) = contradictions(solution)
    with_another_lens = {(name, found.shot): 0.3 for name in found.sensors}
    assert contradictions(solution, with_another_lens) == []


def test_pairs_of_which_most_are_wrong_are_told_with_those_that_agree() -> None:
    with pytest.raises(ContradictionError, match=r"each fits its own corners, to 0\.\d+ and 0\.\d+ px, but only \d"):
        solved({shot: BOARDS[(shot + 5) % 20] for shot in BOARDS})


def test_a_shot_that_is_far_off_from_the_start_is_named() -> None:
    usable, state = start(task({**BOARDS, 4: BOARDS[12]}), lambda _: None)
    assert unlike_the_rest(usable, state).endswith("--skip 4")
    assert unlike_the_rest(*start(task(BOARDS), lambda _: None)) == ""


def test_shots_after_which_a_sensor_was_moved_are_named_as_one_group() -> None:
    later = {shot: moved(T_rb, (0.1, 0, 0)) for shot, T_rb in BOARDS.items() if shot > 12}
    said = unlike_the_rest(*start(task({**BOARDS, **later}), lambda _: None))
    assert "(was a sensor moved before shot 13?)" in said
    assert said.count("px are typical") == 1
    assert said.endswith("--skip 13-19")
