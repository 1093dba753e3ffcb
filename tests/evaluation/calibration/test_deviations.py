"""Stated deviations against what they mean: scatter over other shots of real boards, and errors on simulated ones."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from calib.board.views import CornerView
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from evaluation.calibration import bootstrap, published_boards
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.bent import bent

DRAWS = 100


def ratios(task: Task) -> dict[str, float]:
    """Bootstrap over stated deviation by parameter."""
    return bootstrap.ratios(calibrate(task), DRAWS, np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_deviations_of_a_stereo_pair_are_those_of_a_bootstrap(data_set: Callable[[str], Path]) -> None:
    views = published_boards.stereo(data_set("calib_opencv_stereo"))
    sides = {side: SensorTask(640, 480) for side in ("left", "right")}
    found = ratios(Task(sides, views, (), "left"))
    assert all(0.8 < ratio < 1.3 for ratio in found.values()), found


@pytest.mark.slow
def test_deviations_of_a_camera_whose_views_disagree_are_those_of_a_bootstrap(data_set: Callable[[str], Path]) -> None:
    views, _ = published_boards.circles(data_set("calib_rct_circles"))
    found = ratios(Task({"camera": SensorTask(640, 480)}, views, (), "camera"))
    matrix = [found[f"camera.{name}"] for name in ("fx", "fy", "cx", "cy")]
    assert all(0.8 < ratio < 1.3 for ratio in matrix), found
    assert all(0.65 < ratio < 1.3 for ratio in found.values()), found


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_deviations_are_the_errors_of_simulated_rigs_whose_boards_are_bent() -> None:
    """30 rigs tell a deviation to 13 %. `test_cameras` has rigs with independent corners."""
    errors, stated = [], []
    for seed in range(30):
        generator = np.random.default_rng(seed)
        heads = {name: head for name, head in board_views.three_heads().items() if name != "light"}
        seen = board_views.look(heads, board_views.random_boards(12, generator), generator, points=40)
        corners: list[CornerView] = [bent(view, 0.5, generator) for view in seen.corners]
        sensors = {name: SensorTask(head.camera.width, head.camera.height) for name, head in heads.items()}
        solution = calibrate(Task(sensors, corners, seen.planes, "tof"))
        sigma = {each.name: each.sigma for each in solution.parameters}
        names = [f"{name}.{part}" for name in heads for part in ("fx", "fy", "cx", "cy")]
        found, true = solution.cameras["color"], heads["color"].camera
        differences = [
            getattr(solution.cameras[name], part) - getattr(heads[name].camera, part)
            for name in heads
            for part in ("fx", "fy", "cx", "cy")
        ]
        errors.append([*differences, *(found.T_rs[:3, 3] - true.T_rs[:3, 3])])
        stated.append([sigma[name] for name in (*names, "color.x", "color.y", "color.z")])
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(np.square(stated), axis=0))
    assert 0.75 < np.median(ratio) < 1.2, ratio
    assert np.all((ratio > 0.6) & (ratio < 1.6)), ratio
