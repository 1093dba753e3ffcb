"""Boards in front of stored sensors, of which some may be set free."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.calibration_check.stored import Stored, Views
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.bundle import robust
from calib.solve.bundle.adjustment import Adjustment, adjust, search
from calib.solve.bundle.formulation import Formulation, formulate, groups_of
from calib.solve.bundle.layout import Freedom, Layout
from calib.solve.bundle.lens_parameters import kind_of
from calib.solve.bundle.state import State
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.start.board_poses import sightings


def solve(stored: Stored, views: Views, moving: Collection[str]) -> Adjustment:
    """The boards, and the poses of some sensors, with the deviations that the residuals show."""
    formulation = _formulation(stored, views, moving)
    count = len(groups_of(formulation.task))
    return adjust(formulation, _start(stored, views), count, lambda _: None)


def cost(stored: Stored, views: Views, moving: Collection[str], factors: tuple[float, ...]) -> float:
    """Least robust cost with some sensors set free and given factors of the deviations."""
    formulation = _formulation(stored, views, moving)
    found = search(formulation(_start(stored, views), factors))
    equations = formulation(found, factors)
    return float(np.sum(loss(equations.residuals(np.zeros(equations.layout.size)))))


def loss(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """soft_l1, as the search has it."""
    return 2 * robust.SOFT_L1_SCALE**2 * (np.sqrt(1 + (residuals / robust.SOFT_L1_SCALE) ** 2) - 1)


def _formulation(stored: Stored, views: Views, moving: Collection[str]) -> Formulation:
    names = list(views.shots)
    sensors = {name: _task(stored.sensors[name].camera) for name in names}
    whole = formulate(Task(sensors, views.corners, views.planes, names[0]))
    freedoms = {name: Freedom(sensors[name].lens, (), name in moving) for name in names}
    return replace(whole, layout=Layout(freedoms, whole.layout.shots))


def _task(camera: Camera) -> SensorTask:
    return SensorTask(camera.width, camera.height, kind_of(camera.lens), (camera,), keeps_intrinsics=True)


def _start(stored: Stored, views: Views) -> State:
    """The stored sensors, and boards where the view with the most corners puts them."""
    boards: dict[int, Pose] = {}
    most: dict[int, int] = {}
    for view in views.corners:
        if len(view.pixels) > most.get(view.shot, 0):
            camera = stored.sensors[view.sensor].camera
            allowed = [camera.T_rs @ each.T_sb for each in sightings(camera, view)]
            boards[view.shot] = min(allowed, key=lambda T_rb: _misfit(stored, views, view.shot, T_rb))
            most[view.shot] = len(view.pixels)
    return State({name: stored.sensors[name] for name in views.shots}, boards)


def _misfit(stored: Stored, views: Views, shot: int, T_rb: Pose) -> float:
    """By how much a pose of the board misses the corners of all sensors; a flat board allows two in one image."""
    total = 0.0
    for view in views.corners:
        if view.shot == shot:
            camera = stored.sensors[view.sensor].camera
            misses = np.hypot(*(camera.project(pose.transform(T_rb, view.points_b)) - view.pixels).T)
            total += float(np.mean(np.minimum(np.nan_to_num(misses, nan=np.inf), camera.width)))
    return total
