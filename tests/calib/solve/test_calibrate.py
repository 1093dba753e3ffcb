"""The joint solve on a simulated rig: truth, uncertainty, cross-validation."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from abs_service.calibration.cameras.report import cameras
from calib import pose
from calib.pose import Pose
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_views import Head, Seen


def task_of(heads: Mapping[str, Head], seen: Seen, **changes: object) -> Task:
    """Everything free, with an offset of distances."""
    sensors = {
        name: SensorTask(
            head.camera.width, head.camera.height, depth_terms=("depth_offset",) if head.depth_sigma else ()
        )
        for name, head in heads.items()
    }
    return replace(Task(sensors, seen.corners, seen.planes, "tof"), **changes)  # pyright: ignore[reportArgumentType]


@cache
def solved() -> tuple[dict[str, Head], Solution]:
    generator = np.random.default_rng(11)
    heads = board_views.three_heads()
    heads["tof"] = replace(heads["tof"], depth_offset=0.012)
    seen = board_views.look(heads, board_views.random_boards(16, generator), generator)
    return heads, calibrate(task_of(heads, seen))


def pose_error(solution: Solution, name: str, truth: Pose) -> np.ndarray:
    """Small turn and displacement (6,) from the truth to the solution."""
    found = solution.cameras[name].T_rs
    turn, _ = pose.to_rotation_vector(found @ pose.inverse(truth))
    return np.concatenate([turn, found[:3, 3] - truth[:3, 3]])


def surprise(solution: Solution, heads: Mapping[str, Head], name: str) -> float:
    """Probability of an error less than this one, if the covariance of a sensor's pose is right; 0…1."""
    layout = solution.adjustment.layout
    columns = layout.columns(name, layout.free_parameters[name].names[9:15])
    covariance = solution.covariance[np.ix_(columns, columns)]
    error = pose_error(solution, name, heads[name].camera.T_rs)
    return float(stats.chi2(6).cdf(error @ np.linalg.solve(covariance, error)))


def test_a_rig_of_three_sensors_is_found_within_its_own_deviations() -> None:
    heads, solution = solved()
    for parameter in solution.parameters:
        sensor, _, name = parameter.name.partition(".")
        if name in ("fx", "fy", "cx", "cy"):
            assert abs(parameter.value - getattr(heads[sensor].camera, name)) < 4 * parameter.sigma, parameter.name
    for name in ("light", "color"):
        assert surprise(solution, heads, name) < 0.999
    offset = next(parameter for parameter in solution.parameters if parameter.name == "tof.depth_offset")
    assert abs(offset.value - 0.012) < 4 * offset.sigma < 0.004


def test_deviations_of_corners_and_distances_are_found_from_their_residuals() -> None:
    heads, solution = solved()
    for name, head in heads.items():
        assert solution.deviations[f"{name} corners"] == pytest.approx(head.corner_sigma, rel=0.08)
    assert {view.of for view in solution.views} == {"corners", "distances"}


@pytest.mark.slow
def test_a_good_calibration_is_trusted_and_one_with_a_lens_that_does_not_fit_is_not() -> None:
    _, solution = solved()
    good = assess(solution, 1.0, 2.0)
    assert good.trusted, good.verdict
    assert good.verdict.startswith("Trust it: ")
    assert {agreement.of for agreement in good.agreements} >= {"tof", "light → color"}


@pytest.mark.slow
def test_outliers_neither_pull_the_solution_nor_go_unnoticed() -> None:
    generator = np.random.default_rng(11)
    heads = board_views.three_heads()
    seen = board_views.look(heads, board_views.random_boards(16, generator), generator)
    spoiled = [spoil(view, generator) if index % 3 == 0 else view for index, view in enumerate(seen.corners)]
    solution = calibrate(task_of(heads, replace(seen, corners=spoiled)))
    found = sum(int(view.outliers.sum()) for view in solution.views if view.of == "corners")
    assert found >= 2 * sum(index % 3 == 0 for index in range(len(spoiled)))
    for name in ("light", "color"):
        assert np.linalg.norm(pose_error(solution, name, heads[name].camera.T_rs)[3:]) < 2e-3


def spoil(view, generator: np.random.Generator):
    """A view with three corners somewhere else."""
    pixels = view.pixels.copy()
    pixels[generator.choice(len(pixels), 3, replace=False)] += generator.uniform(5, 15, (3, 2))
    return replace(view, pixels=pixels)


@pytest.mark.slow
def test_a_depth_sensor_without_corners_is_placed_by_planes_alone() -> None:
    generator = np.random.default_rng(4)
    heads = board_views.three_heads()
    seen = board_views.look(heads, board_views.random_boards(16, generator), generator)
    task = task_of(heads, Seen([view for view in seen.corners if view.sensor != "light"], seen.planes))
    camera = heads["light"].camera
    given = SensorTask(camera.width, camera.height, factory=(replace(camera, T_rs=np.eye(4)),), fixed_intrinsics=True)
    solution = calibrate(replace(task, sensors={**task.sensors, "light": given}))
    error = pose_error(solution, "light", camera.T_rs)
    assert np.linalg.norm(error[3:]) < 2e-3
    assert np.linalg.norm(error[:3]) < 4e-3
    assert any(line.startswith("light: boards ") for line in cameras(solution))


@pytest.mark.slow
def test_a_sensor_whose_clock_is_off_is_found_from_a_board_that_moves() -> None:
    generator = np.random.default_rng(9)
    heads = board_views.three_heads()
    shots = np.arange(36)
    late = 0.023
    seen = Seen()
    for name, head in heads.items():
        for shot in shots:
            time = 0.08 * shot + (0.03 if name == "color" else 0)
            true = time + (late if name == "color" else 0)
            seen.corners.extend(board_views.corners(name, head, int(shot), swung(true), generator, time))
            seen.planes.extend(board_views.distances(name, head, int(shot), swung(true), generator, time))
    task = task_of(heads, seen)
    sensors = {**task.sensors, "color": replace(task.sensors["color"], free_running=True)}
    solution = calibrate(replace(task, sensors=sensors))
    found = next(parameter for parameter in solution.parameters if parameter.name == "color.time_offset")
    assert found.value == pytest.approx(late, abs=max(1e-3, 4 * found.sigma))
    assert np.linalg.norm(pose_error(solution, "color", heads["color"].camera.T_rs)[3:]) < 3e-3


def swung(time: float) -> Pose:
    """A board that a hand waves about, slowly enough for shots that are 80 ms apart."""
    turn = pose.from_rotation_vector((0.5 * np.sin(0.9 * time), 0.5 * np.sin(1.3 * time + 1), 0.2), np.zeros(3))
    turn[:3, 3] = (-0.16 + 0.3 * np.sin(0.7 * time), -0.12 + 0.2 * np.sin(1.1 * time), 1 + 0.3 * np.sin(0.5 * time))
    return turn
