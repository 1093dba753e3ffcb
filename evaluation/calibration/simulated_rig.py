"""A simulated rig of three sensors, calibrated with many seeds: errors relative to the covariance."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calib import pose
from calib.camera import Camera
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_views import Head

SEEDS = 50
PLANE_SEEDS = 6
SHOTS = 12
INTRINSICS = 9

#: Deviation of corners in the amplitudes of a coarse time-of-flight camera, which are noisy and blurred [px].
COARSE_PX = 0.6


def error_probabilities(seed: int) -> dict[str, float]:
    """Probability of a smaller error of intrinsics, poses and depth offsets; uniform if the covariance is right."""
    heads, solution = solved(seed)
    found = {}
    for name, head in heads.items():
        names = solution.adjustment.layout.free_parameters[name].names
        error = _intrinsics(solution.cameras[name]) - _intrinsics(head.camera)
        found[f"{name} intrinsics"] = error_probability(solution, name, names[:INTRINSICS], error)
        if name != "tof":
            poses = tuple(each for each in names if each.startswith("rotation") or each in ("x", "y", "z"))
            found[f"{name} pose"] = error_probability(
                solution, name, poses, pose_error(solution.cameras[name], head.camera)
            )
    offset = solution.state.sensors["tof"].depth_offset - heads["tof"].depth_offset
    found["tof depth"] = error_probability(solution, "tof", ("depth_offset",), np.array([offset]))
    return found


def solved(seed: int) -> tuple[Mapping[str, Head], Solution]:
    """True heads of a rig and its calibration, all parameters free."""
    generator = np.random.default_rng(seed)
    heads = board_views.three_heads()
    heads["tof"] = replace(heads["tof"], depth_offset=0.012)
    seen = board_views.look(heads, board_views.random_boards(SHOTS, generator), generator, points=40)
    sensors = {
        name: SensorTask(
            head.camera.width,
            head.camera.height,
            factory=(_nominal(head.camera),),
            depth_terms=("depth_offset",) if name == "tof" else (),
        )
        for name, head in heads.items()
    }
    return heads, calibrate(Task(sensors, seen.corners, seen.planes, "tof"))


def tof_errors(seed: int, corner_sigma: float = COARSE_PX) -> tuple[float, float]:
    """Position errors of a coarse time-of-flight camera [m]: by corners alone, and with planes."""
    generator = np.random.default_rng(1000 + seed)
    heads = {name: head for name, head in board_views.three_heads().items() if name != "light"}
    coarse = Camera(160, 120, 131.0, 130.7, 79.2, 60.4, heads["tof"].camera.lens, heads["color"].camera.T_rs)
    heads["tof"] = Head(coarse, corner_sigma=corner_sigma, depth_sigma=0.004)
    heads["color"] = replace(heads["color"], camera=replace(heads["color"].camera, T_rs=np.eye(4)))
    seen = board_views.look(heads, board_views.random_boards(SHOTS, generator), generator, points=500)
    sensors = {
        "color": SensorTask(1280, 720),
        "tof": SensorTask(160, 120, factory=(_nominal(coarse),)),
    }
    task = Task(sensors, seen.corners, seen.planes, "color")
    found = [calibrate(replace(task, planes=planes)).cameras["tof"] for planes in ((), task.planes)]
    errors = [float(np.linalg.norm(camera.T_rs[:3, 3] - coarse.T_rs[:3, 3])) for camera in found]
    return errors[0], errors[1]


def error_probability(solution: Solution, name: str, names: tuple[str, ...], error: NDArray[np.float64]) -> float:
    """Probability 0…1 of an error smaller than this one (n,) under the covariance of these parameters."""
    columns = solution.adjustment.layout.columns(name, names)
    covariance = solution.covariance[np.ix_(columns, columns)]
    return float(stats.chi2(len(error)).cdf(error @ np.linalg.solve(covariance, error)))


def pose_error(found: Camera, truth: Camera) -> NDArray[np.float64]:
    """Rotation vector and translation (6,) from the true to the calibrated pose."""
    turn, _ = pose.to_rotation_vector(found.T_rs @ pose.inverse(truth.T_rs))
    return np.concatenate([turn, found.T_rs[:3, 3] - truth.T_rs[:3, 3]])


def _nominal(camera: Camera) -> Camera:
    """Intrinsics as of a data sheet: focal length 3 % off, centred, no distortion."""
    focal = 1.03 * camera.fx
    return Camera(camera.width, camera.height, focal, focal, camera.width / 2, camera.height / 2)


def _intrinsics(camera: Camera) -> NDArray[np.float64]:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.lens.coefficients[:5]])
