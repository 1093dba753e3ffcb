"""Bootstrap over the shots of a calibration: how far its parameters scatter when other shots had been taken.

All draws show the same board, so what its bend does to the parameters is in none of their differences.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.adjustment import NotSolvedError, adjust
from calib.solve.bundle.formulation import formulate, groups_of
from calib.solve.bundle.observability import UndeterminedError
from calib.solve.bundle.parameters.state import State
from calib.solve.solution import Solution


def deviations(solution: Solution, count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Deviations (k,) of the sensors' parameters over calibrations from shots drawn with replacement.

    Half the width of the central 68 %: draws of few distinct shots have heavy tails. Draws that determine nothing are
    left out.

    Args:
        solution: of synchronised sensors, from all shots.
        count: number of draws.
        generator: draws the shots.
    """
    free = solution.adjustment.layout.board_start
    found = []
    for _ in range(count):
        drawn = generator.choice(solution.task.shots, len(solution.task.shots)).tolist()
        try:
            found.append(_solved(solution, drawn).values[:free])
        except (NotSolvedError, UndeterminedError):
            continue
    low, high = np.percentile(found, (15.87, 84.13), axis=0)
    return (high - low) / 2


def ratios(solution: Solution, count: int, generator: np.random.Generator) -> dict[str, float]:
    """Ratios of `deviations` to those that the disagreement of the poses states, by the names of the parameters."""
    found = deviations(solution, count, generator)
    stated = np.sqrt(np.diag(solution.adjustment.between_poses))
    return {each.name: ratio for each, ratio in zip(solution.parameters, (found / stated).tolist(), strict=False)}


def _solved(solution: Solution, drawn: list[int]) -> Solution:
    task = solution.task
    corners, planes = (
        {shot: [view for view in views if view.shot == shot] for shot in task.shots}
        for views in (task.corners, task.planes)
    )
    again = replace(
        task,
        corners=[replace(view, shot=to, t_s=to) for to, shot in enumerate(drawn) for view in corners.get(shot, ())],
        planes=[replace(view, shot=to, t_s=to) for to, shot in enumerate(drawn) for view in planes.get(shot, ())],
    )
    start = State(solution.state.sensors, {number: solution.boards[shot] for number, shot in enumerate(drawn)})
    return Solution(again, adjust(formulate(again), start, len(groups_of(again)), lambda _: None))
