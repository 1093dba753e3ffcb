"""Board poses for fixed sensors, of which some may have a free pose."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from calib import pose
from calib.calibration_check.stored_calibration import Stored, Views
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.bundle.adjustment import NotSolvedError, adjust
from calib.solve.bundle.formulation import Formulation, formulate, groups_of
from calib.solve.bundle.parameters.layout import DEPTH_TERMS, FreeParameters, Layout
from calib.solve.bundle.parameters.lens_parameters import kind_of
from calib.solve.bundle.parameters.state import State
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.diagnoses import unlike_the_rest
from calib.solve.solution import Solution
from calib.solve.start.board_poses import pose_candidates


def solve(stored: Stored, views: Views, moving: Collection[str]) -> Solution:
    """Board poses and the poses of `moving` sensors, with estimated deviations.

    Raises:
        NotSolvedError: no convergence; names the shots that even the stored calibration explains worst.
    """
    equations = formulation(stored, views, moving)
    start, count = _start(stored, views), len(groups_of(equations.task))
    try:
        return Solution(equations.task, adjust(equations, start, count, lambda _: None))
    except NotSolvedError as error:
        raise NotSolvedError(f"{error}{unlike_the_rest(equations.task, start)}", error.unfinished) from error


def formulation(
    stored: Stored, views: Views, moving: Collection[str], depth: Collection[str] = (), *, uncertain: bool = False
) -> Formulation:
    """Equations with free boards, free poses of `moving` sensors, and free depth terms of `depth` sensors.

    With `uncertain`, intrinsics with stored deviations are free as well.
    """
    names = list(views.shots)
    sensors = {name: _task(stored.sensors[name].camera) for name in names}
    whole = formulate(Task(sensors, views.corners, views.planes, names[0]))
    free_parameters = {
        name: FreeParameters(sensors[name].lens, (), name in moving, DEPTH_TERMS if name in depth else ())
        for name in names
    }
    if uncertain:
        free_parameters = {name: stored.uncertain(name, free) for name, free in free_parameters.items()}
    return replace(whole, layout=Layout(free_parameters, whole.layout.shots))


def _task(camera: Camera) -> SensorTask:
    return SensorTask(camera.width, camera.height, kind_of(camera.lens), (camera,), fixed_intrinsics=True)


def _start(stored: Stored, views: Views) -> State:
    """Stored sensors, and board poses from the view with the most corners in each shot."""
    boards: dict[int, Pose] = {}
    counts: dict[int, int] = {}
    for view in views.corners:
        if len(view.pixels) > counts.get(view.shot, 0):
            camera = stored.sensors[view.sensor].camera
            allowed = [camera.T_rs @ each.T_sb for each in pose_candidates(camera, view)]
            boards[view.shot] = min(allowed, key=lambda T_rb: _misfit(stored, views, view.shot, T_rb))
            counts[view.shot] = len(view.pixels)
    return State({name: stored.sensors[name] for name in views.shots}, boards)


def _misfit(stored: Stored, views: Views, shot: int, T_rb: Pose) -> float:
    """Reprojection error of a board pose in all sensors; resolves the ambiguity of a planar board."""
    total = 0.0
    for view in views.corners:
        if view.shot == shot:
            camera = stored.sensors[view.sensor].camera
            misses = np.hypot(*(camera.project(pose.transform(T_rb, view.points_b)) - view.pixels).T)
            total += float(np.mean(np.minimum(np.nan_to_num(misses, nan=np.inf), camera.width)))
    return total
