"""A lens of another kind that fits far better is said first: its shots seemed to have focal lengths of their own."""

from dataclasses import replace

import numpy as np

from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.parameters.lens_parameters import BROWN_CONRADY, RATIONAL, LensKind
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.validation.other_lens import other_lenses, undescribed
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views

WIDE = Camera(1024, 768, 420.0, 421.0, 515.0, 380.0, Lens(np.array([0.9, 0.25, 2e-4, -3e-4, 0.02, 1.25, 0.5, 0.06])))


def task(kind: LensKind) -> Task:
    """Boards as near as the image of a wide lens needs, all over it."""
    random, seen = np.random.default_rng(11), list[CornerView]()
    for shot, T_rb in board_views.random_boards(16, random, 0.3, 0.7).items():
        T_rb[:2, 3] *= 2
        seen.extend(board_views.corners("color", board_views.Head(WIDE, 0.1), shot, T_rb, random, shot))
    return Task({"color": SensorTask(1024, 768, kind)}, seen, (), "color")


def test_a_lens_that_fits_far_better_is_said_first() -> None:
    solution = calibrate(task(BROWN_CONRADY))
    (said,) = other_lenses(solution)
    assert said.startswith("color: with a rational lens, corners of an image miss by 0.1")
    assert said.endswith("--lens color=rational")
    assert assess(solution, 0.5, 1.0).verdict == f"Do not trust it yet: {said}"


def test_a_lens_that_fits_is_not_named() -> None:
    assert other_lenses(calibrate(task(RATIONAL))) == []


def behind_a_wavy_window(shift_px: float) -> Task:
    """Views as through plastic foil: corners are displaced by where they are in the image."""
    head = board_views.Head(board_views.three_heads()["color"].camera, 0.1)
    boards = board_views.random_boards(24, np.random.default_rng(3), 0.5, 0.8)
    seen = board_views.look({"color": head}, boards, np.random.default_rng(4))
    wavy = [
        replace(view, pixels=np.clip(view.pixels + shift_px * np.sin(view.pixels / (30, 25)), 0, (1279, 719)))
        for view in seen.corners
    ]
    return Task({"color": SensorTask(1280, 720)}, wavy, (), "color")


def test_what_no_kind_of_lens_describes_is_not_trusted() -> None:
    solution = calibrate(behind_a_wavy_window(0.7))
    (said,) = undescribed(solution, 1.0)
    assert said.startswith("color: corners miss by 0.56 px in the same places of the image in all shots")
    assert assess(solution, 1.0, 1.0).reasons == [said]  # nothing else shows it
    assert undescribed(calibrate(behind_a_wavy_window(0.0)), 0.1) == []
