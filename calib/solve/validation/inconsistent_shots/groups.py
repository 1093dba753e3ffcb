"""Shots in two groups with optics of their own: two cameras, zoomed, turned, mirrored or cropped images.

Such a set is explained by something in between, with small residuals. Each distinct pose pulls the solution with its
own score (see `calib.solve.bundle.uncertainty`); two groups are those whose principal points or focal lengths, one for
each, explain these scores best. Errors of lens and board pull the poses apart as well, but not into two clusters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.solve.regrouping.two_groups import numbered, two_groups
from calib.solve.solution import Solution
from calib.solve.validation.board_shape import NOTICED, effect_px
from calib.solve.validation.free_shape import AlongDirections, FreeShape, Members, along, disagreement, once, without
from calib.solve.validation.inconsistent_shots.steadiness import HARMLESS, from_middle_px, of_focal, optics
from calib.solve.validation.projection_uncertainty import reach

#: Minimum number of distinct poses, as any few fall into two groups, and of those in the smaller group.
POSES, MIN_MEMBERS = 12, 3

#: Minimum gain of a pose in squared deviations, as the poses disagree within their groups. Real sets of one camera have
#: 3.5 at most, 2.0 for focal lengths; where those of a third of the images differ by 3 %, that is 7 to 70.
GAIN = 4.0

#: Largest ratio of the disagreement about focal lengths within two groups to that of all; even ones have 0.25.
ALIKE = 1 / 6

#: Focal lengths that are known to no better than this [1] leave principal points open.
KNOWN = 0.02

#: Random first groups, steps from each, and the largest ratio of what is known of two directions.
STARTS, STEPS, CONDITION = 30, 40, 1e9

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Groups:
    """A sensor whose shots fall into two groups.

    Attributes:
        sensor: its name.
        shots: those of the smaller group.
        shift: of its principal point from that of the others (2,) [px], or, relative, of its focal length (1,).
        alone: True if there is no other sensor, so that a turn of this one is one of all boards.
        advice: what to do.
    """

    sensor: str
    shots: tuple[int, ...]
    shift: Array
    alone: bool
    advice: str

    def __str__(self) -> str:
        """One sentence for people."""
        shots = numbered(self.shots)
        if len(self.shift) == 1:
            return (
                f"{self.sensor}: shots {shots} have a focal length of their own, {self.shift[0]:+.1%} from that of the "
                "others: were these images zoomed, refocused, cropped or resized? Switch autofocus, zoom and image "
                f"stabilisation off. {self.advice}"
            )
        across, down = self.shift.tolist()
        turned = "" if self.alone else ", or did a sensor turn, or the board move between the images of a shot"
        return (
            f"{self.sensor}: shots {shots} have a principal point of their own, ({across:+.1f}, {down:+.1f}) px from "
            "that of the others: are these images of two cameras, or were some turned by 180°, mirrored, cropped, "
            f"stretched or stabilised, or taken in motion{turned}? {self.advice}"
        )


def groups(free: FreeShape, needed_px: float) -> list[Groups]:
    """Sensors with two groups of shots, whose optics differ by what matters if `needed_px` [px] are needed."""
    found, of_shots = [], free.solution.adjustment.equations.poses
    sigmas = {each.name: each.sigma / each.value for each in free.solution.parameters if each.name.endswith(".fx")}
    for name, directions in optics(free):
        if sigmas[f"{name}.fx"] > KNOWN:
            continue
        # Focal lengths, or principal points: what explains more.
        parts = directions[:, :1], directions[:, 1:]
        split, part = max(((_split(free, part), part) for part in parts), key=lambda each: each[0].gain)
        if split.gain < GAIN or split.is_uneven or _is_harmless(free.solution, name, part, split.change, needed_px):
            continue
        chosen = np.isin(of_shots, np.unique(of_shots)[split.members])
        shots = [
            shot for shot, is_chosen in zip(free.solution.adjustment.layout.shots, chosen, strict=True) if is_chosen
        ]
        # Scores are derivatives of what is predicted minus what is measured.
        found.append(_settled(free.solution, name, tuple(sorted(shots)), -split.change))
    return found


def _is_harmless(solution: Solution, name: str, directions: Array, change: Array, needed_px: float) -> bool:
    """True if projections need not be known so well that a change (m,) along directions (k, m) of the optics matters.

    Boards that are placed anew undo most of another principal point; only other sensors see that.
    """
    if len(change) == 1:
        return abs(change[0]) * from_middle_px(solution, name) < HARMLESS * needed_px
    if len(solution.task.sensors) > 1:
        return float(np.linalg.norm(change)) < HARMLESS * needed_px
    return effect_px(solution, directions @ change, float(np.mean(reach(solution, name)))) < NOTICED * needed_px


def _settled(solution: Solution, name: str, shots: tuple[int, ...], shift: Array) -> Groups:
    """Groups after each shot went to the one that explains it better; the smaller one is named."""
    advice, alone = f"Look at both groups, and leave one out: --skip {numbered(shots)}", len(solution.task.sensors) == 1
    for two in two_groups(solution.task, solution.cameras, [shots]):
        is_other = 2 * len({*shots} & {*two.smaller}) < len(two.smaller)
        shots, shift, advice = two.smaller, -shift if is_other else shift, two.advice
    return Groups(name, shots, shift, alone, advice)


@dataclass(frozen=True)
class _Split:
    """The two groups that explain most.

    Attributes:
        gain: squared deviations that they explain of each pose, as the poses disagree within them; 0 with too few.
        members: poses of the smaller group (poses,).
        change: of these from the others, along the directions that were asked for (m,).
        is_uneven: True if focal lengths differ within the groups, too.
    """

    gain: float
    members: Members
    change: Array
    is_uneven: bool = False


def _split(free: FreeShape, directions: Array) -> _Split:
    """Groups of poses that differ along directions (k, m)."""
    poses = once(free.poses)
    count = len(poses.scores)
    if count < POSES:
        return _Split(0.0, np.zeros(count, np.bool_), np.zeros(directions.shape[1]))
    known = along(directions, poses.information, free.poses.prior)
    pulls = poses.scores @ directions
    random = np.random.default_rng(0)
    first = [random.random(count) < share for share in np.resize((0.25, 0.5, 0.75), STARTS)]
    best = max((_grown(guess, known, pulls) for guess in first), key=lambda each: each.gain)
    members, change = best.members, best.change
    within = without(poses, known, members, change)
    gain = best.gain / (count * disagreement(poses.information, within))
    is_uneven = False
    if len(change) == 1:
        before, after = (
            of_focal(poses.information, free.poses.prior, each, directions[:, 0]).ratio
            for each in (poses.scores, within)
        )
        is_uneven = after > ALIKE * before
    if 2 * members.sum() > count:
        members, change = ~members, -change
    return _Split(gain, members, change, is_uneven)


def _grown(members: Members, known: AlongDirections, pulls: Array) -> _Split:
    """A group from a first guess (poses,), its gain in squared deviations of all poses; none if too few are left.

    Args:
        members: the guess.
        known: information of the poses.
        pulls: their scores along the directions (poses, m).
    """
    gain, change = 0.0, np.zeros(pulls.shape[1])
    for _ in range(STEPS):
        together = known.whole[members].sum(axis=0)
        curvature = known.own[members].sum(axis=0) - together.T @ together
        if not MIN_MEMBERS <= members.sum() <= len(members) - MIN_MEMBERS or np.linalg.cond(curvature) > CONDITION:
            return _Split(0.0, members, np.zeros_like(change))
        pull = pulls[members].sum(axis=0)
        change = np.linalg.solve(curvature, pull)
        gain = float(change @ pull)
        costs = 0.5 * (known.own @ change) @ change - (known.whole @ change) @ (together @ change) - pulls @ change
        if np.array_equal(costs < 0, members):
            break
        members = costs < 0
    return _Split(gain, members, change)
