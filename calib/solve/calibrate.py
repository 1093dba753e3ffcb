"""Calibration from views to a solution."""

from collections.abc import Callable

from calib.solve import diagnoses
from calib.solve.bundle.adjustment import NotSolvedError, adjust
from calib.solve.bundle.formulation import formulate, groups_of
from calib.solve.bundle.parameters.state import State
from calib.solve.bundle.tasks import Task
from calib.solve.solution import Solution
from calib.solve.start.board_poses import untilted
from calib.solve.start.start import start


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
        why = diagnoses.unlike_the_rest(task, start) or untilted(start.boards.values())
        raise NotSolvedError(f"{error}{why}") from error
