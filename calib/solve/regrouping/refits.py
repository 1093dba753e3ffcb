"""Cameras and boards fitted to some shots: what a group of shots says, and of which others."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.views import CornerView
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.bundle.adjustment import search
from calib.solve.bundle.formulation import formulate
from calib.solve.bundle.parameters.layout import turned
from calib.solve.bundle.parameters.lens_parameters import ASPECT
from calib.solve.bundle.tasks import Task
from calib.solve.start.board_poses import pose_candidates
from calib.solve.start.start import start

#: Gauss-Newton steps of a board, each halved this often where it goes astray.
_STEPS, _HALVES = 6, 3

#: The second pose that a planar board may have is tried as well if it misses by less than this many times the first.
_RIVAL = 3.0

#: A board behind a camera misses by this much [px].
_BEHIND = 1e3


def corners_alone(task: Task, cameras: Mapping[str, Camera]) -> Task:
    """Task of the corners, beginning with the cameras."""
    sensors = {}
    for name in dict.fromkeys(view.sensor for view in task.corners):
        camera = replace(cameras[name], T_rs=pose.identity())
        sensors[name] = replace(
            task.sensors[name], factory=(camera,), fixed_pose=False, depth_terms=(), free_running=False
        )
    reference = task.reference if task.reference in sensors else next(iter(sensors))
    return replace(task, sensors=sensors, planes=(), reference=reference)


def with_held_lenses(task: Task) -> Task:
    """Task whose lenses stay as they are: a few shots say little of them, where others were."""
    sensors = {
        name: replace(sensor, fixed=tuple(sorted({*sensor.fixed, *sensor.lens.coefficients, ASPECT})))
        for name, sensor in task.sensors.items()
    }
    return replace(task, sensors=sensors)


def fitted(task: Task, shots: Sequence[int]) -> dict[str, Camera]:
    """Cameras that explain some shots.

    Raises:
        ValueError: nothing does.
    """
    usable, state = start(task.of_shots(shots), lambda _: None)
    found = search(formulate(usable).as_measured(state))
    return {name: sensor.camera for name, sensor in found.sensors.items()}


def misses(task: Task, cameras: Mapping[str, Camera]) -> NDArray[np.float64]:
    """Root mean square by which the corners of each shot miss, with its board where they fit best (shots,) [px]."""
    by_shot: dict[int, list[CornerView]] = {shot: [] for shot in task.shots}
    for view in task.corners:
        by_shot[view.shot].append(view)
    return np.array([_miss(cameras, views) for views in by_shot.values()])


def _miss(cameras: Mapping[str, Camera], views: Sequence[CornerView]) -> float:
    first = [
        cameras[view.sensor].T_rs @ each.T_sb for view in views for each in pose_candidates(cameras[view.sensor], view)
    ]
    ranked = sorted((_rms(_off(cameras, views, T_rb)), index) for index, T_rb in enumerate(first))[:2]
    tried = [index for miss, index in ranked if miss <= _RIVAL * ranked[0][0]]
    return min((_best(cameras, views, first[index]) for index in tried), default=_BEHIND)


def _best(cameras: Mapping[str, Camera], views: Sequence[CornerView], T_rb: Pose) -> float:
    """Root mean square residual of the corners of a shot at the board pose that fits best near the given one [px]."""
    off = _off(cameras, views, T_rb)
    for _ in range(_STEPS):
        step = -np.linalg.lstsq(_jacobian(cameras, views, T_rb), off.ravel())[0]
        places = [turned(T_rb, step / 2**halves) for halves in range(_HALVES)]
        tried = [(place, _off(cameras, views, place)) for place in places]
        moved, after = min(tried, key=lambda each: _rms(each[1]))
        if _rms(after) > 0.999 * _rms(off):
            break
        T_rb, off = moved, after
    return _rms(off)


def _off(cameras: Mapping[str, Camera], views: Sequence[CornerView], T_rb: Pose) -> NDArray[np.float64]:
    found = [cameras[view.sensor].project(pose.transform(T_rb, view.points_b)) - view.pixels for view in views]
    return np.nan_to_num(np.concatenate(found), nan=_BEHIND)


def _jacobian(cameras: Mapping[str, Camera], views: Sequence[CornerView], T_rb: Pose) -> NDArray[np.float64]:
    """Derivatives (2 n, 6) of what corners miss by with respect to increments of the board's pose."""
    found = []
    for view in views:
        arms = view.points_b @ T_rb[:3, :3].T
        moved = np.concatenate([np.cross(np.eye(3), arms[:, None]), np.broadcast_to(np.eye(3), (len(arms), 3, 3))], 1)
        found.append(cameras[view.sensor].projection_jacobian(arms + T_rb[:3, 3]) @ moved.transpose(0, 2, 1))
    return np.nan_to_num(np.concatenate(found)).reshape(-1, 6)


def _rms(off: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
