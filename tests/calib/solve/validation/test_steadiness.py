"""Sensors that were refocused, shifted or moved between shots are named with the shot, and no others."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib import pose
from calib.board.views import CornerView
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.free_shape import disagreement, free_shape
from calib.solve.validation.inconsistent_shots.steadiness import (
    changes_of_optics,
    changes_of_place,
    focal_scatter,
    unseen_change,
)
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views

HEADS = {name: head for name, head in board_views.three_heads().items() if name != "tof"}
SIZE = (1280, 720)


@cache
def views() -> tuple[CornerView, ...]:
    """One camera, 24 shots."""
    generator = np.random.default_rng(1)
    head = board_views.Head(replace(HEADS["color"].camera, T_rs=np.eye(4)), 0.1)
    return tuple(board_views.look({"color": head}, board_views.random_boards(24, generator), generator).corners)


def zoomed(by: Callable[[int], float]) -> list[CornerView]:
    """Views whose image is enlarged about its middle; it never reaches the border."""
    middle = np.array([639.5, 359.5])
    return [replace(view, pixels=(view.pixels - middle) * by(view.shot) + middle) for view in views()]


def solved(seen: Sequence[CornerView]) -> Solution:
    return calibrate(Task({"color": SensorTask(*SIZE)}, seen, (), "color"))


def test_a_camera_that_stays_as_it_is_has_no_change() -> None:
    solution = solved(views())
    assert not changes_of_optics(free_shape(solution), 1.0)
    assert not focal_scatter(free_shape(solution), 1.0)


def test_a_camera_that_focuses_half_way_is_named_with_the_shot() -> None:
    solution = solved(zoomed(lambda shot: 0.985 if shot >= 12 else 1.0))
    (found,) = changes_of_optics(free_shape(solution), 1.0)
    assert found.sensor == "color"
    assert found.shot == pytest.approx(12, abs=2)
    assert found.values[0] == pytest.approx(-0.015, abs=0.003)
    verdict = assess(solution, 1.0, 1.0).verdict
    expected = f"Do not trust it yet: color: projects otherwise from about shot {found.shot} on: focal length by -1."
    assert verdict.startswith(expected)


@pytest.mark.parametrize("larger_later", [False, True])
def test_a_change_of_the_size_that_is_said_to_show_is_named(larger_later: bool) -> None:
    """A zoom by 3 % half way was trusted without a word, if boards had little tilt."""
    free = free_shape(solved(views()))
    least = unseen_change(free)["color"]
    assert 0.003 < least < 0.03
    assert (
        f" A change of its focal length half way of less than {least:.1%} would" in assess(free.solution, 1, 1).verdict
    )
    changed = free_shape(solved(zoomed(lambda shot: 1 - least * ((shot < 12) == larger_later))))
    assert len(changes_of_optics(changed, 1.0)) == 1


def test_poses_that_only_a_camera_with_fixed_intrinsics_saw_know_nothing_and_do_not_count() -> None:
    """The mean was NaN with boards of few corners, and no group of shots was found."""
    information, scores = np.stack([np.zeros((2, 2)), np.eye(2)]), np.array([[0.0, 0.0], [2.0, 2.0]])
    assert disagreement(information, scores) == 4.0
    assert disagreement(information[:1], scores[:1]) == 1.0


def test_without_tilt_and_with_few_poses_larger_changes_do_not_show() -> None:
    generator = np.random.default_rng(3)
    boards = board_views.random_boards(24, generator, tilt=(0.05, 0.3))
    head = board_views.Head(replace(HEADS["color"].camera, T_rs=np.eye(4)), 0.1)
    flat = board_views.look({"color": head}, boards, generator).corners
    least = [unseen_change(free_shape(solved(seen)))["color"] for seen in (views(), flat, views()[:11])]
    assert 2 * least[0] < least[1] < least[2] == np.inf


def test_an_image_that_is_shifted_by_a_stabiliser_half_way_is_named() -> None:
    seen = [replace(view, pixels=view.pixels - (5, 3)) if view.shot >= 12 else view for view in views()]
    inside = [view for view in seen if view.pixels.min() > 0]
    (found,) = changes_of_optics(free_shape(solved(inside)), 1.0)
    assert found.shot == pytest.approx(12, abs=3)
    assert found.values[1:] == pytest.approx([-5, -3], abs=1.5)


def test_a_camera_that_focuses_in_every_shot_is_named() -> None:
    generator = np.random.default_rng(4)
    factors = 0.97 + 0.015 * generator.uniform(-1.7, 1.7, 24)
    solution = solved(zoomed(lambda shot: float(factors[shot])))
    assert focal_scatter(free_shape(solution), 1.0)["color"] == pytest.approx(0.015, abs=0.006)
    assert "its focal length differs by ± 1." in assess(solution, 1.0, 1.0).verdict


@cache
def rig(from_shot: int, degrees: float, millimetres: float) -> Solution:
    """Two cameras, of which one is bumped before a shot of 20."""
    generator = np.random.default_rng(1)
    boards = board_views.random_boards(20, generator)
    bump = pose.from_rotation_vector((0, np.radians(degrees), 0), (millimetres * 1e-3, 0, 0))
    color = HEADS["color"]
    after = replace(color, camera=replace(color.camera, T_rs=color.camera.T_rs @ bump))
    seen = [view for view in board_views.look(HEADS, boards, generator).corners if view.sensor == "light"]
    for head, shots in ((color, range(from_shot)), (after, range(from_shot, 20))):
        seen += board_views.look({"color": head}, {shot: boards[shot] for shot in shots}, generator).corners
    sensors = {name: SensorTask(head.camera.width, head.camera.height) for name, head in HEADS.items()}
    return calibrate(Task(sensors, seen, (), "light"))


def test_a_rig_that_stays_as_it_is_has_no_change() -> None:
    assert not changes_of_place(free_shape(rig(20, 0, 0)), 1.0)


@pytest.mark.parametrize(("shot", "degrees", "millimetres"), [(10, 0.1, 0), (15, 0, 2)])
def test_a_camera_that_was_bumped_is_named_with_the_shot(shot: int, degrees: float, millimetres: float) -> None:
    solution = rig(shot, degrees, millimetres)
    (found,) = changes_of_place(free_shape(solution), 1.0)
    assert (found.sensor, found.shot) == ("color", shot)
    assert np.degrees(np.linalg.norm(found.values[:3])) == pytest.approx(degrees, abs=0.05)
    assert 1e3 * np.linalg.norm(found.values[3:]) == pytest.approx(millimetres, abs=1)
    verdict = assess(solution, 1.0, 1.0).verdict
    assert verdict.startswith(f"Do not trust it yet: color: stands elsewhere from about shot {shot} on, ")
