"""First guesses of two groups of shots."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.solve.bundle.tasks import Task
from calib.solve.solution import Solution
from calib.solve.start.board_poses import pose_candidates

#: Shots that are tried as the middle of a cluster.
_TRIED = 50


def by_relative_pose(task: Task, cameras: Mapping[str, Camera]) -> set[int]:
    """Shots of one of two groups, by where two sensors stand to each other in each shot; shows what moved far."""
    names = [*dict.fromkeys(view.sensor for view in task.corners)][:2]
    boards: dict[int, dict[str, NDArray[np.float64]]] = {}
    for view in task.corners:
        if view.sensor in names and (found := pose_candidates(cameras[view.sensor], view)):
            boards.setdefault(view.shot, {})[view.sensor] = found[0].T_sb
    places = {}
    for shot, seen in boards.items():
        if len(seen) == 2:
            turn, move = pose.to_rotation_vector(seen[names[0]] @ pose.inverse(seen[names[1]]))
            places[shot] = np.concatenate([turn * np.linalg.norm(seen[names[0]][:3, 3]), move])
    return _clusters(places)


def by_residuals(solution: Solution) -> set[int]:
    """Shots of one of two groups, by where the corners of each sensor are from their predictions; shows small moves."""
    names = [*dict.fromkeys(view.sensor for view in solution.task.corners)]
    means: dict[int, NDArray[np.float64]] = {}
    for view in solution.views:
        if view.of == "corners":
            row = means.setdefault(view.shot, np.zeros((len(names), 2)))
            row[names.index(view.sensor)] = np.median(view.residuals, axis=0)
    return _clusters({shot: row.ravel() for shot, row in means.items()})


def _clusters(places: Mapping[int, NDArray[np.float64]]) -> set[int]:
    """Shots of one of two clusters, about the two medoids."""
    if len(places) < 2:
        return set()
    every = np.stack([*places.values()])
    apart = np.linalg.norm(every[:: 1 + len(every) // _TRIED, None] - every, axis=2)
    sums = np.minimum(apart[:, None], apart).sum(axis=2)
    a, b = np.unravel_index(sums.argmin(), sums.shape)
    return {shot for shot, nearer in zip(places, apart[a] < apart[b], strict=True) if nearer}
