"""Pixels that would not be square are doubted, such as those of a board that moved while its rows were read."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.square_pixels import doubts, not_square
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views

TRUE = Camera(640, 480, 536.0, 537.5, 331.0, 236.0, Lens(np.array([-0.28, 0.09, 0.0006, -0.0004, 0.0])))
READOUT_S = 1 / 30


def rolling_shutter(speed: float, turn: float = 0.0) -> list[CornerView]:
    """A board that sinks [m/s], as does all that a camera sees that turns up [rad/s], while rows are read from the top.

    Each corner stands where its row shows it.
    """
    random = np.random.default_rng(4)
    views = []
    for shot, T_rb in board_views.random_boards(16, random, 0.7, 1.3, (0.1, 0.7)).items():
        pixels = board_views.projected(TRUE, T_rb, board_views.board_points())
        for _ in range(5):
            later = READOUT_S * (pixels[:, 1] / TRUE.height - 0.5)
            for index, delay in enumerate(later):
                sunk = T_rb.copy()
                sunk[1, 3] += speed * delay
                sunk = pose.from_rotation_vector((-turn * delay, 0, 0), np.zeros(3)) @ sunk
                pixels[index] = board_views.projected(TRUE, sunk, board_views.board_points()[index : index + 1])[0]
        pixels += random.normal(0, 0.05, pixels.shape)
        if np.all((pixels > 0) & (pixels < (639, 479))):
            views.append(CornerView("color", shot, float(shot), board_views.board_points(), pixels, 0.05))
    return views


def solved(views: list[CornerView], *given: Camera) -> Solution:
    return calibrate(Task({"color": SensorTask(640, 480, factory=given)}, views, (), "color"))


def test_a_board_that_sank_while_rows_were_read_is_not_trusted() -> None:
    assessment = assess(solved(rolling_shutter(0.3)), 1.0, 1.0)
    assert not assessment.trusted
    assert any("wider than high, and those of sensors are square" in reason for reason in assessment.reasons)


def test_a_board_that_was_held_still_is_trusted() -> None:
    assert assess(solved(rolling_shutter(0.0)), 1.0, 1.0).trusted


def test_a_camera_that_is_given_with_such_pixels_dispels_the_doubt() -> None:
    solution = solved(rolling_shutter(0.3))
    other = solution.cameras["color"]
    assert doubts(not_square(solution, 1.0), 1.0)
    assert not not_square(replace(solution, task=solved(rolling_shutter(0.3), other).task), 1.0)


def test_a_camera_that_turned_while_rows_were_read_is_not_trusted() -> None:
    """It was trusted, with 0.06 px claimed where errors were 0.7 px."""
    solution = solved(rolling_shutter(0.0, 0.15))
    found = not_square(solution, 1.0)
    assert found["color"].ratio == pytest.approx(np.log(537.5 / 536) + 0.15 * READOUT_S * 536 / 480, rel=0.2)
    assert "and those of sensors are square" in assess(solution, 1.0, 1.0).verdict


def test_what_square_pixels_would_change_is_said() -> None:
    verdict = assess(solved(rolling_shutter(0.0)), 1.0, 1.0).verdict
    assert verdict.startswith("Trust it")
    assert " If pixels of color are square, projections change by up to 0." in verdict
