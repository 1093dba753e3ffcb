"""Calibration from views to a solution."""

from collections.abc import Callable
from contextlib import suppress

from calib.solve import diagnoses
from calib.solve.bundle.adjustment import NotSolvedError, adjust
from calib.solve.bundle.formulation import formulate, groups_of
from calib.solve.bundle.parameters.state import State
from calib.solve.bundle.tasks import Task
from calib.solve.regrouping.initial_groups import by_relative_pose
from calib.solve.regrouping.two_groups import two_groups
from calib.solve.solution import Solution
from calib.solve.start.board_poses import untilted
from calib.solve.start.start import start
from calib.solve.start.undistorted import lenses_beside_distances, undistorted

#: Two groups explain why there is no minimum if corners miss this many times more with the cameras of the other group.
_APART = 3.0


def calibrate(task: Task, note: Callable[[str], None] = lambda _: None) -> Solution:
    """Solves a calibration task.

    Raises:
        ViewsError, MixedUpError, SquareSizeError: common mistakes; see `diagnoses`.
        NotConnectedError, ContradictionError: sensors without consistent common views; see `extrinsics_graph`.
        UndeterminedError: parameters that the views do not determine, by name.
        NotSolvedError: no convergence.
    """
    diagnoses.require_views(task)
    diagnoses.require_matching_sensors(task)
    usable, state = start(task, note)
    if diagnoses.suspect_square_size(usable, state):
        note("distances do not fit the board's size: solving with their scales free to be sure")
        diagnoses.require_square_size(_solve(diagnoses.with_free_scales(usable), state, note).parameters)
    return _solve(usable, state, note)


def _solve(task: Task, start: State, note: Callable[[str], None]) -> Solution:
    formulation = formulate(task)
    groups = groups_of(task)
    note(f"all together: {formulation.layout.size} parameters of {len(groups)} groups of views")
    try:
        return Solution(task, adjust(formulation, start, len(groups), note))
    except NotSolvedError as error:
        if bent := lenses_beside_distances(task):
            note("no minimum; once more, from lenses without distortion")
            with suppress(NotSolvedError):
                return Solution(task, adjust(formulation, undistorted(task, bent, start), len(groups), note))
        why = _two(task, start) or diagnoses.unlike_the_rest(task, start) or untilted(start.boards.values())
        raise NotSolvedError(f"{error}{why}") from error


def _two(task: Task, start: State) -> str:
    """Two groups of shots that have no minimum together, as the end of a sentence; "" if there are none."""
    if len(task.sensors) < 2 or any(sensor.free_running for sensor in task.sensors.values()):
        return ""
    cameras = {name: sensor.camera for name, sensor in start.sensors.items()}
    found = two_groups(task, cameras, [by_relative_pose(task, cameras)])
    said = [str(two) for two in found if two.other_px > _APART * two.alone_px]
    return "".join(f". {each[:1].upper()}{each[1:]}" for each in said)
