"""Pose of the board at an exposure: at its shot, or interpolated between two shots for a free-running sensor.

Between two shots the board rotates about a fixed axis and translates along a line, both at constant speed; the shots'
times are those of the sensors on the rig's clock. Before the first and after the last shot the motion is extrapolated.
A static board gives no information on the clock offset, and a jerk between two shots biases it: shots of a moving board
should be 0.1 s or less apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle import rotations


@dataclass(frozen=True)
class ShotPoses:
    """Poses `T_rb` of all shots, with the derivative of their rotations with respect to the increments.

    Attributes:
        rotations: (shots, 3, 3).
        translations: (shots, 3) [m].
        left_jacobians: (shots, 3, 3): small rotation of the board about the rig's axes per increment of its rotation.
        times: of the shots on the rig's clock (shots,) [s].
    """

    rotations: NDArray[np.float64]
    translations: NDArray[np.float64]
    left_jacobians: NDArray[np.float64]
    times: NDArray[np.float64]


@dataclass(frozen=True)
class ViewPoses:
    """Board poses in the views of one group.

    Attributes:
        rotations, translations: pose in every view (views, 3, 3) and (views, 3).
        shots: rows of the shots that each pose depends on (views, 1 or 2).
        by_shots: small rotation and translation per increment of each of those shots (views, 1 or 2, 6, 6).
        by_time: small rotation and translation per second (views, 6).
    """

    rotations: NDArray[np.float64]
    translations: NDArray[np.float64]
    shots: NDArray[np.intp]
    by_shots: NDArray[np.float64]
    by_time: NDArray[np.float64]


def at_shots(boards: ShotPoses, rows: NDArray[np.intp]) -> ViewPoses:
    """Board poses in the views (views,) of a synchronised sensor: those of their shots."""
    blocks = np.zeros((len(rows), 1, 6, 6))
    blocks[:, 0, :3, :3] = boards.left_jacobians[rows]
    blocks[:, 0, 3:, 3:] = np.eye(3)
    return ViewPoses(boards.rotations[rows], boards.translations[rows], rows[:, None], blocks, np.zeros((len(rows), 6)))


def between_shots(boards: ShotPoses, pairs: NDArray[np.intp], times: NDArray[np.float64]) -> ViewPoses:
    """Board poses in the views of a free-running sensor, interpolated.

    Args:
        boards: poses of the shots.
        pairs: rows of the two shots around, or next to, each view (views, 2).
        times: of the views on the rig's clock (views,) [s].
    """
    first, second = pairs.T
    # A static shot is paired with itself.
    span = np.where(first == second, 1.0, boards.times[second] - boards.times[first])
    share = np.where(first == second, 0.0, (times - boards.times[first]) / span)[:, None]
    turn = rotations.logarithm(boards.rotations[second] @ boards.rotations[first].transpose(0, 2, 1))
    partial = rotations.exponential(share * turn)
    run = boards.translations[second] - boards.translations[first]
    # The left Jacobian maps increments of the rotation vector to rotations of the interpolated pose; its inverses map
    # rotations of either end to increments: log(exp(a) exp(r) exp(-b)) = r + J(r)⁻¹ a - J(-r)⁻¹ b.
    part = share[..., None] * rotations.left_jacobian(share * turn)
    blocks = np.zeros((len(pairs), 2, 6, 6))
    by_first = partial - part @ np.linalg.inv(rotations.left_jacobian(-turn))
    by_second = part @ np.linalg.inv(rotations.left_jacobian(turn))
    blocks[:, 0, :3, :3] = by_first @ boards.left_jacobians[first]
    blocks[:, 1, :3, :3] = by_second @ boards.left_jacobians[second]
    blocks[:, 0, 3:, 3:] = (1 - share)[..., None] * np.eye(3)
    blocks[:, 1, 3:, 3:] = share[..., None] * np.eye(3)
    speed = np.concatenate([turn, run], axis=1) / span[:, None]
    placed = partial @ boards.rotations[first]
    return ViewPoses(placed, boards.translations[first] + share * run, pairs, blocks, speed)


def neighbours(times: NDArray[np.float64], shots: NDArray[np.float64], maximum_gap: float) -> NDArray[np.intp]:
    """Rows (views, 2) of the shots around or next to each view; (-1, -1) for a view without two such shots.

    Args:
        times: of the views (views,) [s].
        shots: of the shots, ascending (shots,) [s].
        maximum_gap: largest gap between two shots of one motion [s].
    """
    gaps = np.flatnonzero(np.diff(shots) <= maximum_gap)
    found = np.full((len(times), 2), -1, np.intp)
    if gaps.size:
        middles = (shots[gaps] + shots[gaps + 1]) / 2
        nearest = gaps[np.abs(times[:, None] - middles).argmin(axis=1)]
        near = (times > shots[nearest] - maximum_gap) & (times < shots[nearest + 1] + maximum_gap)
        found[near] = np.stack([nearest, nearest + 1], axis=1)[near]
    return found


def rows(shots: Sequence[int], wanted: Sequence[int]) -> NDArray[np.intp]:
    """Positions of the wanted numbers in a list of shots."""
    positions = {shot: row for row, shot in enumerate(shots)}
    return np.array([positions[shot] for shot in wanted], np.intp)
