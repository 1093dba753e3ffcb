"""Where the board was when a sensor exposed: at its shot, or between two shots if the sensor's clock runs freely.

Between two shots the board turns about a fixed axis and moves along a line, both at constant speed; the times of the
shots are those of the sensors whose clock is the rig's. Beyond the first and the last shot the motion goes on. A board
that stands still says nothing of a clock, and one that is jerked between two shots says something wrong: shots of a
moving board should follow each other closely, 0.1 s or less apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle import rotations


@dataclass(frozen=True)
class Boards:
    """Poses `T_rb` of all shots, and what an increment of each does to it.

    Attributes:
        rotations: (shots, 3, 3).
        translations: (shots, 3) [m].
        chains: (shots, 3, 3): small turn of the board about the rig's axes per increment of its rotation.
        times: when the shots were on the rig's clock (shots,) [s].
    """

    rotations: NDArray[np.float64]
    translations: NDArray[np.float64]
    chains: NDArray[np.float64]
    times: NDArray[np.float64]


@dataclass(frozen=True)
class Placed:
    """The board as some views saw it.

    Attributes:
        rotations, translations: its pose in every view (views, 3, 3) and (views, 3).
        shots: rows of the shots that each pose depends on (views, 1 or 2).
        by_shots: small turn and displacement per increment of each of those (views, 1 or 2, 6, 6).
        by_time: the same per second (views, 6).
    """

    rotations: NDArray[np.float64]
    translations: NDArray[np.float64]
    shots: NDArray[np.intp]
    by_shots: NDArray[np.float64]
    by_time: NDArray[np.float64]


def at_shots(boards: Boards, rows: NDArray[np.intp]) -> Placed:
    """Views (views,) of synchronised sensors: each at its shot."""
    blocks = np.zeros((len(rows), 1, 6, 6))
    blocks[:, 0, :3, :3] = boards.chains[rows]
    blocks[:, 0, 3:, 3:] = np.eye(3)
    return Placed(boards.rotations[rows], boards.translations[rows], rows[:, None], blocks, np.zeros((len(rows), 6)))


def between_shots(boards: Boards, pairs: NDArray[np.intp], times: NDArray[np.float64]) -> Placed:
    """Views of a sensor that runs freely.

    Args:
        boards: the shots.
        pairs: rows of the two shots that each view lies between, or next to (views, 2).
        times: when the views were taken on the rig's clock (views,) [s].
    """
    first, second = pairs.T
    # A shot without a neighbour is its own: the board stood still.
    span = np.where(first == second, 1.0, boards.times[second] - boards.times[first])
    share = np.where(first == second, 0.0, (times - boards.times[first]) / span)[:, None]
    turn = rotations.logarithm(boards.rotations[second] @ boards.rotations[first].transpose(0, 2, 1))
    partial = rotations.exponential(share * turn)
    run = boards.translations[second] - boards.translations[first]
    # The left Jacobian takes increments of the whole turn to turns of the part; its inverses take turns of either end
    # to increments of the whole: log(exp(a) exp(r) exp(-b)) = r + J(r)⁻¹ a - J(-r)⁻¹ b.
    part = share[..., None] * rotations.left_jacobian(share * turn)
    blocks = np.zeros((len(pairs), 2, 6, 6))
    by_first = partial - part @ np.linalg.inv(rotations.left_jacobian(-turn))
    by_second = part @ np.linalg.inv(rotations.left_jacobian(turn))
    blocks[:, 0, :3, :3] = by_first @ boards.chains[first]
    blocks[:, 1, :3, :3] = by_second @ boards.chains[second]
    blocks[:, 0, 3:, 3:] = (1 - share)[..., None] * np.eye(3)
    blocks[:, 1, 3:, 3:] = share[..., None] * np.eye(3)
    speed = np.concatenate([turn, run], axis=1) / span[:, None]
    placed = partial @ boards.rotations[first]
    return Placed(placed, boards.translations[first] + share * run, pairs, blocks, speed)


def neighbours(times: NDArray[np.float64], shots: NDArray[np.float64], longest_gap: float) -> NDArray[np.intp]:
    """Rows (views, 2) of the shots that views at some times lie between.

    Args:
        times: of the views (views,) [s].
        shots: of the shots, ascending (shots,) [s].
        longest_gap: between two shots of one motion [s].

    Returns:
        (-1, -1) for a view with no two such shots around it or next to it.
    """
    gaps = np.flatnonzero(np.diff(shots) <= longest_gap)
    found = np.full((len(times), 2), -1, np.intp)
    if gaps.size:
        middles = (shots[gaps] + shots[gaps + 1]) / 2
        nearest = gaps[np.abs(times[:, None] - middles).argmin(axis=1)]
        near = (times > shots[nearest] - longest_gap) & (times < shots[nearest + 1] + longest_gap)
        found[near] = np.stack([nearest, nearest + 1], axis=1)[near]
    return found


def rows(shots: Sequence[int], wanted: Sequence[int]) -> NDArray[np.intp]:
    """Where the wanted numbers are in a list of shots."""
    positions = {shot: row for row, shot in enumerate(shots)}
    return np.array([positions[shot] for shot in wanted], np.intp)
