"""Images of two cameras, or turned, mirrored or cropped ones, among a camera's images are named; other sets are not."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.board.views import CornerView
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.free_shape import free_shape
from calib.solve.validation.inconsistent_shots.groups import groups
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views
from tests.calib.solve.validation.test_steadiness import HEADS, SIZE, views

ODD = (2, 3, 7, 11, 12, 16, 20, 21)


def turned(view: CornerView) -> CornerView:
    return replace(view, pixels=(SIZE[0] - 1, SIZE[1] - 1) - view.pixels)


def mirrored(view: CornerView) -> CornerView:
    """Corners as a detector numbers those of a chessboard that it sees in a mirror: along the rows, from the left."""
    pixels = np.stack([SIZE[0] - 1 - view.pixels[:, 0], view.pixels[:, 1]], axis=1)
    across = (board_views.COLUMNS - 1) * board_views.SQUARE - view.points_b[:, 0]
    return replace(view, pixels=pixels, points_b=np.column_stack([across, view.points_b[:, 1:]]))


def of_another_camera(view: CornerView) -> CornerView:
    return replace(view, pixels=view.pixels - (-7, 5))


def zoomed(view: CornerView) -> CornerView:
    middle = (np.array(SIZE) - 1) / 2
    return replace(view, pixels=(view.pixels - middle) * 0.95 + middle)


@cache
def solved(change: Callable[[CornerView], CornerView]) -> Solution:
    seen = [change(view) if view.shot in ODD else view for view in views()]
    inside = [view for view in seen if np.all((view.pixels > 0) & (view.pixels < np.array(SIZE) - 1))]
    return calibrate(Task({"color": SensorTask(*SIZE)}, inside, (), "color"))


def test_images_of_one_camera_are_one_group() -> None:
    assert not groups(free_shape(solved(replace)), 1.0)


@pytest.mark.parametrize("change", [turned, mirrored, of_another_camera])
def test_images_that_are_unlike_the_others_are_named(change: Callable[[CornerView], CornerView]) -> None:
    solution = solved(change)
    (found,) = groups(free_shape(solution), 1.0)
    assert len(set(found.shots) ^ set(ODD)) <= 2  # some views show hardly anything of the principal point


def test_the_shift_of_a_second_camera_has_its_sign() -> None:
    (found,) = groups(free_shape(solved(of_another_camera)), 1.0)
    assert found.shift == pytest.approx([7, -5], abs=1.5)


def test_a_second_principal_point_counts_by_what_boards_that_are_placed_anew_leave_of_it() -> None:
    """Images that a camera sharpens give sure corners, so that shifts of less than a pixel are sure as well."""
    generator = np.random.default_rng(1)
    head = board_views.Head(replace(HEADS["color"].camera, T_rs=np.eye(4)), 0.01)
    seen = board_views.look({"color": head}, board_views.random_boards(24, generator), generator).corners
    moved = [replace(view, pixels=view.pixels - (-0.7, 0.5)) if view.shot in ODD else view for view in seen]
    free = free_shape(calibrate(Task({"color": SensorTask(*SIZE)}, moved, (), "color")))
    assert not groups(free, 1.0)
    (found,) = groups(free, 0.1)
    assert len(set(found.shots) ^ set(ODD)) <= 2


def test_zoomed_images_are_named_with_their_focal_length() -> None:
    (found,) = groups(free_shape(solved(zoomed)), 1.0)
    assert len(set(found.shots) ^ set(ODD)) <= 2
    assert found.shift == pytest.approx([-0.05], abs=0.01)
    assert " have a focal length of their own, -" in assess(solved(zoomed), 1.0, 1.0).verdict


def test_the_verdict_names_them_and_how_to_leave_them_out() -> None:
    verdict = assess(solved(turned), 1.0, 1.0).verdict
    assert verdict.startswith("Do not trust it yet: color: shots 2-3,7,")
    assert verdict.endswith("leave one out: --skip 2-3,7,11-12,16,20-21")


def test_of_several_sensors_one_may_have_turned() -> None:
    heads = {name: replace(head, depth_sigma=0.0) for name, head in board_views.three_heads().items() if name != "tof"}
    generator = np.random.default_rng(0)
    seen = board_views.look(heads, board_views.random_boards(24, generator), generator).corners
    turned_by_px = [
        replace(view, pixels=view.pixels + np.array([0, 1.2])) if view.sensor == "color" and view.shot in ODD else view
        for view in seen
    ]
    sensors = {name: SensorTask(head.camera.width, head.camera.height) for name, head in heads.items()}
    found = groups(free_shape(calibrate(Task(sensors, turned_by_px, (), "color"))), 1.0)
    assert any("or taken in motion, or did a sensor turn, or the board move" in str(each) for each in found)
    assert "turn, or the board" not in str(groups(free_shape(solved(of_another_camera)), 1.0)[0])
