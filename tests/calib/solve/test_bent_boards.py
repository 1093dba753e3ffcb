"""± of a camera's parameters from few poses of a board that is bent alike in all of them, and of a flat one."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.bundle.uncertainty import pose_covariance
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from evaluation.scenes.boards import board_views

TRUE = Camera(640, 480, 536.0, 537.5, 331.0, 236.0, Lens(np.array([-0.28, 0.09, 0.0006, -0.0004, 0.0])))
RIGS, POSES, NOISE_PX = 12, 8, 0.1


@cache
def solved(bend_mm: float, seed: int) -> Solution:
    """Camera from a board that is bent like a part of a cylinder, from the middle to the shorter edges."""
    random = np.random.default_rng(seed)
    flat = board_views.board_points()
    bent = flat.copy()
    bent[:, 2] = bend_mm / 1e3 * (2 * flat[:, 0] / np.ptp(flat[:, 0]) - 1) ** 2
    views = []
    for shot, T_rb in board_views.random_boards(POSES, random, 0.7, 1.3, (0.1, 0.7)).items():
        pixels = board_views.projected(TRUE, T_rb, bent) + random.normal(0, NOISE_PX, (len(bent), 2))
        views.append(CornerView("color", shot, float(shot), flat, pixels, NOISE_PX))
    inside = [view for view in views if np.all((view.pixels > 0) & (view.pixels < (639, 479)))]
    return calibrate(Task({"color": SensorTask(640, 480)}, inside, (), "color"))


def errors(solution: Solution) -> NDArray[np.float64]:
    return np.array([getattr(solution.cameras["color"], name) - getattr(TRUE, name) for name in ("fx", "fy")])


@pytest.mark.parametrize("bend_mm", [0.0, 0.5, 1.5])
def test_errors_are_as_large_as_stated(bend_mm: float) -> None:
    solutions = [solved(bend_mm, seed) for seed in range(RIGS)]
    stated = [[each.sigma for each in solution.parameters[:2]] for solution in solutions]
    ratio = np.sqrt(np.mean(np.square([errors(each) for each in solutions])) / np.mean(np.square(stated)))
    assert 0.6 < ratio < 1.3


def test_a_flat_board_adds_nothing_to_speak_of() -> None:
    growths = []
    for seed in range(RIGS):
        adjustment = solved(0.0, seed).adjustment
        without = pose_covariance(adjustment.pose_information, adjustment.noise)
        growths.append(np.sqrt(adjustment.covariance[0, 0] / without[0, 0]))
    assert np.median(growths) < 1.02
    assert np.mean(growths) < 1.1
