"""Initial state in which lenses that few coarse corners determine begin without distortion."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.solve.bundle.adjustment import search
from calib.solve.bundle.formulation import formulate
from calib.solve.bundle.parameters.state import SensorState, State
from calib.solve.bundle.tasks import SensorTask, Task


def lenses_beside_distances(task: Task) -> dict[str, SensorTask]:
    """Sensors that measure distances and have free coefficients of their lens, by name."""
    measuring = {view.sensor for view in task.planes}
    return {name: sensor for name, sensor in task.sensors.items() if name in measuring and _free(sensor)}


def undistorted(task: Task, bent: Mapping[str, SensorTask], state: State) -> State:
    """State found with all measurements together, first without the distortion of the `bent` sensors.

    Coarse corners alone may leave a lens that hardly has an inverse where distances were measured, beside them. From
    there the search ends where the lenses beyond have none.

    Raises:
        NotSolvedError: the searches have no minimum.
    """
    straight = {name: _straight(sensor, state.sensors[name]) for name, sensor in bent.items()}
    held = {name: replace(each, fixed=(*each.fixed, *each.lens.coefficients)) for name, each in bent.items()}
    found = _searched(task, held, replace(state, sensors={**state.sensors, **straight}))
    simpler = {name: each.with_lens(kind) for name, each in bent.items() for kind in each.lens.simpler}
    return _searched(task, simpler, found) if simpler else found


def _free(sensor: SensorTask) -> list[str]:
    return [each for each in sensor.free_parameters(True).intrinsics if each in sensor.lens.coefficients]


def _straight(sensor: SensorTask, state: SensorState) -> SensorState:
    """State with 0 for every free coefficient of the lens."""
    free = np.isin(sensor.lens.every, _free(sensor))
    lens = sensor.lens.make(np.where(free, 0.0, state.camera.lens.coefficients))
    return replace(state, camera=replace(state.camera, lens=lens))


def _searched(task: Task, changed: Mapping[str, SensorTask], state: State) -> State:
    task = replace(task, sensors={**task.sensors, **changed})
    return search(formulate(task).as_measured(state))
