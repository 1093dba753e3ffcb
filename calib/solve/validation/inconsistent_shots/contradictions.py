"""Shots that contradict the rest of a solution.

In a rig all sensors share one pose of the board per shot. If two images of a shot show the board in different places,
because they were paired wrongly or the board moved between them, each fits alone and both together do not.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from calib import pose
from calib.board.views import CornerView
from calib.pose import Pose
from calib.solve.regrouping.two_groups import unexplained
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.start.board_poses import PoseCandidate, pose_candidates

#: Corners of a view that contradict: their median residual in deviations. Normal errors have 1.18, …
_DEVIATIONS = 3.0
#: … and where residuals are this small they harm nothing, or the lens fits nearly if another would leave so little
#: [px].
_HARMLESS_PX = 0.5
#: Fraction of outliers among the distances of a view that contradicts.
_OUTLIERS = 0.5
#: Largest fraction of outliers of a group.
_MAX_OUTLIERS = 0.1
#: Above this fraction of contradicting shots there is no rest that they contradict.
_MAX_SHARE = 1 / 3
#: Images of a shot that fit this many times better alone are of different moments.
_BETTER = 3.0
#: Exchanged images put the board in the same place again to this share of what they are apart.
_SAME = 0.2


@dataclass(frozen=True)
class Contradiction:
    """A shot that the solution of all others does not explain.

    Attributes:
        shot: its number.
        sensors: whose view misses most, and, if each of the two fits alone, the other one of the pair.
        miss: root mean square residual of the first one's view [px], or [m] for distances.
        median: over its views.
        of: "corners" or "distances".
        apart: distance of the boards that the two see [m]; 0 for a single sensor.
        exchanged_with: shots whose image of one sensor fits that of the other here.
    """

    shot: int
    sensors: tuple[str, ...]
    miss: float
    median: float
    of: str
    apart: float = 0.0
    exchanged_with: tuple[int, ...] = ()

    def __str__(self) -> str:
        """One clause for people."""
        unit, scale = ("px", 1.0) if self.of == "corners" else ("mm", 1e3)
        miss, median = (f"{rounded(scale * each)} {unit}" for each in (self.miss, self.median))
        said = f"{self.of} of {self.sensors[0]} miss by {miss}, {median} are typical"
        if self.apart:
            said += f"; {' and '.join(self.sensors)} see the board {self.apart * 1e3:.1f} mm apart, and each fits alone"
        if self.exchanged_with:
            said += f"; one of its pictures belongs to shot {' or '.join(map(str, self.exchanged_with))}"
        return f"shot {self.shot}: {said}"


class _Seen(NamedTuple):
    """Pose of the board by one image, and how far its corners miss [px]."""

    T_rb: Pose
    rms_px: float


def contradictions(solution: Solution, left: Mapping[tuple[str, int], float] = {}) -> list[Contradiction]:
    """Shots that contradict the rest, the worst first; empty if they are too many to have a rest.

    Args:
        solution: from all shots.
        left: what corners miss by if board and lenses may have any smooth shape, by sensor and shot, where known [px].
    """
    boards = _boards(solution)
    found = [one for shot in solution.task.shots if (one := _of_shot(solution, shot, boards, left)) is not None]
    if len(found) > _MAX_SHARE * len(solution.task.shots):
        return []
    return sorted(found, key=lambda one: -one.miss / one.median)


def completed(solution: Solution, found: Sequence[Contradiction]) -> list[Contradiction]:
    """Shots that the others contradict once all of these are left out: some hid behind them, some suffered from them.

    Args:
        solution: from all shots.
        found: by `contradictions`.
    """
    if not found:
        return []
    far = unexplained(solution.task, solution.cameras, {one.shot for one in found})
    boards = _boards(solution)
    known = [one for one in found if one.shot in far or one.of != "corners"]
    hidden = [_hidden(solution, shot, far[shot], boards) for shot in {*far} - {one.shot for one in found}]
    return [*known, *hidden] or [*found]


def _of_shot(
    solution: Solution,
    shot: int,
    boards: Mapping[tuple[str, int], _Seen],
    left: Mapping[tuple[str, int], float],
) -> Contradiction | None:
    """The worst view of a shot, if it contradicts."""
    worst: Contradiction | None = None
    for view in solution.views:
        if view.shot != shot:
            continue
        others = [one.rms for one in solution.views if (one.sensor, one.of) == (view.sensor, view.of)]
        median = max(float(np.median(others)), 1e-12)
        if view.of == "corners":
            sizes = np.linalg.norm(view.residuals, axis=1) / solution.deviations[f"{view.sensor} corners"]
            miss = min(view.rms, left.get((view.sensor, shot), np.inf))
            is_bad = float(np.median(sizes)) > _DEVIATIONS and miss > _HARMLESS_PX
        else:
            is_bad = float(np.mean(view.outliers)) > _OUTLIERS
        if is_bad and (worst is None or view.rms / median > worst.miss / worst.median):
            worst = Contradiction(shot, (view.sensor,), view.rms, median, view.of)
    return None if worst is None else _with_partner(worst, boards)


def _hidden(solution: Solution, shot: int, miss: float, boards: Mapping[tuple[str, int], _Seen]) -> Contradiction:
    """A shot whose corners miss by this much [px] once others are left out."""
    worst = max((one for one in solution.views if (one.shot, one.of) == (shot, "corners")), key=lambda one: one.rms)
    median = float(np.median([one.rms for one in solution.views if (one.sensor, one.of) == (worst.sensor, worst.of)]))
    return _with_partner(Contradiction(shot, (worst.sensor,), miss, median, "corners"), boards)


def _with_partner(found: Contradiction, boards: Mapping[tuple[str, int], _Seen]) -> Contradiction:
    """Contradiction with the other sensor of a pair whose views each fit alone, and the shots that would fit."""
    own = {sensor: each for (sensor, shot), each in boards.items() if shot == found.shot}
    pairs = [
        (_apart(own[a].T_rb, own[b].T_rb), a, b)
        for a, b in combinations(own, 2)
        if found.of == "corners"
        and found.sensors[0] in (a, b)
        and max(own[a].rms_px, own[b].rms_px) * _BETTER < found.miss
    ]
    if not pairs:
        return found
    apart, a, b = max(pairs)
    first, second = (a, b) if a == found.sensors[0] else (b, a)
    others = {
        shot
        for (sensor, shot), seen in boards.items()
        for here in (a, b)
        if shot != found.shot
        and sensor in (a, b)
        and sensor != here
        and _apart(seen.T_rb, own[here].T_rb) < _SAME * apart
    }
    return replace(found, sensors=(first, second), apart=apart, exchanged_with=tuple(sorted(others)))


def _apart(T_ra: Pose, T_rb: Pose) -> float:
    return float(np.linalg.norm(T_ra[:3, 3] - T_rb[:3, 3]))


def _boards(solution: Solution) -> dict[tuple[str, int], _Seen]:
    """Pose of the board `T_rb` and residual [px] by sensor and shot, each from that one image."""
    found = {}
    for view in solution.task.corners:
        if candidates := pose_candidates(solution.cameras[view.sensor], view):
            found[view.sensor, view.shot] = _nearest(candidates, solution, view)
    return found


def _nearest(candidates: Sequence[PoseCandidate], solution: Solution, view: CornerView) -> _Seen:
    """Pose of a view's board alone; where both poses of a planar board fit, the nearer to the solution's."""
    T_rs = solution.cameras[view.sensor].T_rs
    allowed = [one for one in candidates if one.rms_px < 2 * candidates[0].rms_px]
    board = solution.boards.get(view.shot)
    if board is None:
        return _Seen(T_rs @ candidates[0].T_sb, candidates[0].rms_px)
    turned = [np.linalg.norm(pose.to_rotation_vector(T_rs @ one.T_sb @ pose.inverse(board))[0]) for one in allowed]
    best = allowed[int(np.argmin(turned))]
    return _Seen(T_rs @ best.T_sb, best.rms_px)


def outliers(solution: Solution, named: Collection[int]) -> list[str]:
    """Reasons to doubt groups with too many outliers, but for those of shots that are named anyway."""
    found = []
    for sensor, of in dict.fromkeys((view.sensor, view.of) for view in solution.views if view.shot not in named):
        views = [view for view in solution.views if (view.sensor, view.of) == (sensor, of) and view.shot not in named]
        far = sum(int(view.outliers.sum()) for view in views)
        every = sum(len(view.outliers) for view in views)
        if far > _MAX_OUTLIERS * every:
            worst = max(views, key=lambda view: view.outliers.mean())
            found.append(
                f"{sensor}: {far} of {every} {of} are outliers, most in shot {worst.shot}; look at its picture, "
                "and leave it out if the board moved or is covered"
            )
    return found
