"""Conversion of a task to equations about a state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.board.views import CornerView, PlaneView
from calib.solve.bundle import motion
from calib.solve.bundle.blocks import Corners, Planes
from calib.solve.bundle.equations import Equations, Group
from calib.solve.bundle.parameters.layout import Layout
from calib.solve.bundle.parameters.state import State
from calib.solve.bundle.tasks import Task
from calib.solve.bundle.variance_components import rescale


@dataclass(frozen=True)
class Formulation:
    """Task as a function from a state and deviation factors to equations.

    Attributes:
        task: the calibration task.
        layout: parameter vector.
        shot_times: times of the layout's shots on the rig's clock (shots,) [s].
        poses: number of the distinct board pose that each of them shows (shots,).
    """

    task: Task
    layout: Layout
    shot_times: NDArray[np.float64]
    poses: NDArray[np.intp]

    def __call__(self, state: State, factors: tuple[float, ...]) -> Equations:
        """Equations about a state, with the deviations of every group multiplied by its factor."""
        groups = [self._group(sensor, views, state) for sensor, views in groups_of(self.task)]
        return rescale(Equations(self.layout, state, groups, self.shot_times, self.poses), factors)

    def as_measured(self, state: State) -> Equations:
        """Equations about a state, with the deviations that the measurements come with."""
        return self(state, (1.0,) * len(groups_of(self.task)))

    def _group(self, sensor: str, views: Sequence[CornerView | PlaneView], state: State) -> Group:
        shots = [view.shot for view in views]
        times = np.array([view.t_s for view in views])
        if self.task.sensors[sensor].free_running:
            on_rig = times + state.sensors[sensor].time_offset
            rows = motion.neighbours(on_rig, self.shot_times, self.task.maximum_gap)
            for index in np.flatnonzero(rows[:, 0] < 0):
                rows[index] = self._still(shots[index], on_rig[index])
        else:
            rows = motion.rows(self.layout.shots, shots)
        return Group(sensor, _measured(views), rows, times)

    def _still(self, shot: int, time: float) -> int:
        """Row of the shot if it has a pose of its own, as for a static board; otherwise of the nearest in time."""
        if shot in self.layout.shots:
            return self.layout.shots.index(shot)
        return int(np.abs(self.shot_times - time).argmin())


def formulate(task: Task) -> Formulation:
    """Equations of a task."""
    times = _shot_times(task)
    order = sorted(times, key=lambda shot: (times[shot], shot))
    free_parameters = {name: sensor.free_parameters(name != task.reference) for name, sensor in task.sensors.items()}
    return Formulation(
        task,
        Layout(free_parameters, order),
        np.array([times[shot] for shot in order]),
        np.array([task.poses[shot] for shot in order], np.intp),
    )


def groups_of(task: Task) -> list[tuple[str, Sequence[CornerView | PlaneView]]]:
    """Views by sensor and kind, corners before planes."""
    groups: list[tuple[str, Sequence[CornerView | PlaneView]]] = []
    for name in task.sensors:
        corners = [view for view in task.corners if view.sensor == name]
        planes = [view for view in task.planes if view.sensor == name]
        groups += [(name, views) for views in (corners, planes) if views]
    return groups


def _shot_times(task: Task) -> Mapping[int, float]:
    """Mean time of each shot on the rig's clock.

    A shot without synchronised views is omitted if its board pose can be interpolated between shots around it.
    """
    synchronised: dict[int, list[float]] = {}
    free: dict[int, list[float]] = {}
    for view in (*task.corners, *task.planes):
        times = free if task.sensors[view.sensor].free_running else synchronised
        times.setdefault(view.shot, []).append(view.t_s)
    means = {shot: float(np.mean(times)) for shot, times in synchronised.items()}
    lonely = {shot: float(np.mean(times)) for shot, times in free.items() if shot not in synchronised}
    around = motion.neighbours(np.array([*lonely.values()]), np.sort([*means.values()]), task.maximum_gap)
    return means | {shot: time for (shot, time), rows in zip(lonely.items(), around, strict=True) if rows[0] < 0}


def _measured(views: Sequence[CornerView | PlaneView]) -> Corners | Planes:
    counts = [len(view.pixels) for view in views]
    numbers = np.repeat(np.arange(len(views)), counts)
    pixels = np.concatenate([view.pixels for view in views]).astype(float)
    corners = [view for view in views if isinstance(view, CornerView)]
    if corners:
        points = np.concatenate([view.points_b for view in corners]).astype(float)
        sigmas = np.repeat([view.sigma_px for view in corners], counts)
        return Corners(points, pixels, sigmas, numbers)
    planes = [view for view in views if isinstance(view, PlaneView)]
    distances = np.concatenate([view.distances for view in planes]).astype(float)
    return Planes(pixels, distances, np.concatenate([view.sigmas for view in planes]).astype(float), numbers)
