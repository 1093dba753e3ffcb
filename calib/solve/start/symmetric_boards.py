"""Boards that look the same upside down: corners numbered from the same end in all sensors of a shot.

Alone, an image leaves open from which of the two ends such a board is numbered, so corners are numbered from the left.
Where the board stands upright in the image, or a sensor is rolled, left is another end for another sensor.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from calib import pose
from calib.board.views import CornerView
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.start.board_poses import PoseCandidate, pose_candidates


def both_ways(
    seen: Mapping[str, Mapping[int, Sequence[PoseCandidate]]], views: Sequence[CornerView]
) -> dict[str, dict[int, list[PoseCandidate]]]:
    """Pose candidates by sensor and shot, together with those of the board numbered from its other end."""
    turn = _half_turn(views)
    return {
        name: {shot: [*found, *(replace(one, T_sb=one.T_sb @ turn) for one in found)] for shot, found in shots.items()}
        for name, shots in seen.items()
    }


def numbered_alike(views: Sequence[CornerView], cameras: Mapping[str, Camera]) -> list[CornerView]:
    """Views whose corners are numbered from the same end as in the first view of their shot.

    Args:
        views: of a board that looks the same upside down.
        cameras: by name, with their poses in the rig; views of other sensors stay as they are.
    """
    turn = _half_turn(views)
    first: dict[int, list[Pose]] = {}
    found = []
    for view in views:
        if view.sensor not in cameras:
            found.append(view)
            continue
        boards = [cameras[view.sensor].T_rs @ each.T_sb for each in pose_candidates(cameras[view.sensor], view)]
        others = first.setdefault(view.shot, boards)
        alike, opposite = (_apart(others, [board @ end for board in boards]) for end in (pose.identity(), turn))
        found.append(_turned(view, turn) if opposite < alike else view)
    return found


def _half_turn(views: Sequence[CornerView]) -> Pose:
    """Half a turn of the board about its middle; it is its own inverse."""
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    turn[:2, 3] = np.max([view.points_b.max(axis=0) for view in views], axis=0)[:2]
    return turn


def _turned(view: CornerView, turn: Pose) -> CornerView:
    return replace(view, points_b=pose.transform(turn, view.points_b))


def _apart(some: Sequence[Pose], others: Sequence[Pose]) -> float:
    """Smallest angle between two poses, one of each [rad]; NaN without any."""
    traces = [float(np.trace(a[:3, :3].T @ b[:3, :3])) for a, b in product(some, others)]
    return float(np.arccos(np.clip((max(traces) - 1) / 2, -1, 1))) if traces else float("nan")
