"""A lens of another kind that fits far better is said first: its shots seemed to have focal lengths of their own."""

import numpy as np

from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.parameters.lens_parameters import BROWN_CONRADY, RATIONAL, LensKind
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.validation.other_lens import other_lenses
from calib.solve.validation.verdict import assess
from tests.calib.solve import board_views

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
