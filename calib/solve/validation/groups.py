"""Shots in two groups of which each has a principal point of its own: two cameras, turned, mirrored or cropped images.

Such a set is explained by something in between, with small residuals. Each distinct pose pulls the solution with its
own score (see `calib.solve.bundle.uncertainty`); two groups are those whose principal points, one for each, explain
these scores best. Errors of lens and board pull the poses apart as well, but not into two heaps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from calib.solve.solution import Solution
from calib.solve.validation.steadiness import HARMLESS, along, disagreement, once, optics

#: Minimum number of distinct poses, as any few fall into two groups, and of those in the smaller group.
POSES, LEAST = 12, 3

#: Minimum gain of a pose in squared deviations, as the poses disagree within their groups. Real sets of one camera have
#: 2.2 at most, those of two cameras 23 and more, and 4 to 6 those whose principal points are 1.5 % of the width apart.
GAIN = 3.0

#: Random first groups, steps from each, and the largest ratio of what is known of two directions.
STARTS, STEPS, CONDITION = 30, 40, 1e9

Array = NDArray[np.float64]
Members = NDArray[np.bool_]


@dataclass(frozen=True)
class Groups:
    """A sensor whose shots fall into two groups.

    Attributes:
        sensor: its name.
        shots: those of the smaller group.
        shift: of its principal point from that of the others (2,) [px].
    """

    sensor: str
    shots: tuple[int, ...]
    shift: Array

    def __str__(self) -> str:
        """One sentence for people."""
        across, down = self.shift.tolist()
        shots = ",".join(map(str, self.shots))
        return (
            f"{self.sensor}: shots {shots} have a principal point of their own, ({across:+.1f}, {down:+.1f}) px from "
            "that of the others: are these images of two cameras, or were some turned by 180°, mirrored, cropped, "
            f"stretched or stabilised, or taken in motion? Look at both groups, and leave one out: --skip {shots}"
        )


def groups(solution: Solution, needed_px: float) -> list[Groups]:
    """Sensors with two groups of shots, whose principal points are at least half of `needed_px` [px] apart."""
    found, of_shots = [], solution.adjustment.equations.poses
    for name, directions in optics(solution):
        split = _split(solution, directions[:, 1:])
        if split is None or np.linalg.norm(split[1]) < HARMLESS * needed_px:
            continue
        members, shift = split
        chosen = np.isin(of_shots, np.unique(of_shots)[members])
        shots = [shot for shot, is_chosen in zip(solution.adjustment.layout.shots, chosen, strict=True) if is_chosen]
        found.append(Groups(name, tuple(sorted(shots)), shift))
    return found


def _split(solution: Solution, directions: Array) -> tuple[Members, Array] | None:
    """Smaller group of poses, and its change (m,) along directions (k, m) from the others; None without groups."""
    information, scores = once(solution.adjustment.pose_information)
    count = len(scores)
    if count < POSES:
        return None
    lower, own, whole = along(directions, information, solution.adjustment.pose_information.prior)
    pulls = scores @ directions
    random = np.random.default_rng(0)
    first = [random.random(count) < share for share in np.resize((0.25, 0.5, 0.75), STARTS)]
    gain, members, change = max((_grown(guess, own, whole, pulls) for guess in first), key=lambda each: each[0])
    others = -linalg.solve_triangular(lower, whole[members].sum(axis=0) @ change, lower=True, trans=1)
    changes = others + np.outer(members, directions @ change)
    within = scores - (information @ changes[:, :, None])[:, :, 0]
    if gain < GAIN * count * disagreement(information, within):
        return None
    return (members, change) if 2 * members.sum() <= count else (~members, -change)


def _grown(members: Members, own: Array, whole: Array, pulls: Array) -> tuple[float, Members, Array]:
    """Gain [deviations²], poses of a group, and its change (m,), from a first guess; no gain if too few are left.

    Args:
        members: the guess (poses,).
        own, whole, pulls: of poses: information (poses, m, m), its root from all (poses, k, m), and pulls (poses, m).
    """
    gain, change = 0.0, np.zeros(pulls.shape[1])
    for _ in range(STEPS):
        together = whole[members].sum(axis=0)
        curvature = own[members].sum(axis=0) - together.T @ together
        if not LEAST <= members.sum() <= len(members) - LEAST or np.linalg.cond(curvature) > CONDITION:
            return 0.0, members, np.zeros_like(change)
        pull = pulls[members].sum(axis=0)
        change = np.linalg.solve(curvature, pull)
        gain = float(change @ pull)
        costs = 0.5 * (own @ change) @ change - (whole @ change) @ (together @ change) - pulls @ change
        if np.array_equal(costs < 0, members):
            break
        members = costs < 0
    return gain, members, change
