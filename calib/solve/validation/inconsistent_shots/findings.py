"""Findings on shots that do not show the same board and rig as the others, the most likely cause first."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from calib.solve.calibrate import calibrate
from calib.solve.regrouping.initial_groups import by_residuals
from calib.solve.regrouping.two_groups import TwoGroups, numbered, two_groups
from calib.solve.solution import Solution
from calib.solve.validation.board_shape import ShapeError
from calib.solve.validation.free_shape import FreeShape
from calib.solve.validation.inconsistent_shots import changes
from calib.solve.validation.inconsistent_shots.contradictions import Contradiction, completed, contradictions
from calib.solve.validation.inconsistent_shots.foreign_distances import wrong_distances
from calib.solve.validation.inconsistent_shots.groups import groups
from calib.solve.validation.inconsistent_shots.scatter import SCATTERS_PX, Scatter, scatter, typical_alone
from calib.solve.validation.inconsistent_shots.steadiness import changes_of_optics, changes_of_place, focal_scatter
from calib.solve.validation.rolling_shutter import Motion

#: Two groups are the explanation if corners then miss by at most this many times what they do in each image alone, …
_EXPLAINED = 1.5
#: … and with the cameras of the other group by this many times as much at least. Groups of cameras that were moved have
#: 6; any shots can be split into two that differ by chance, as those of a hand-held board by 1.4.
_APART = 3.0


class ShotDoubts(NamedTuple):
    """Reasons to doubt that all shots show one board and one rig, shots that contradict, and likely causes."""

    reasons: Sequence[str]
    contradicting: Sequence[Contradiction]
    causes: Sequence[str]


def inconsistent_shots(free: FreeShape, shared: Sequence[ShapeError | Motion], needed_px: float) -> ShotDoubts:
    """Looks whether all shots show one board and one rig, beside the errors that they share."""
    solution = free.solution
    if wrong := wrong_distances(solution, needed_px):
        return ShotDoubts([*map(str, wrong)], [], [])  # they pull everything else along
    moved = changes_of_place(free, needed_px)
    # What happened to a sensor looks as if its image changed, and a wrong board as if every shot had another lens.
    changed = [] if moved else changes_of_optics(free, needed_px)
    confirmed = [changes.is_confirmed(solution, one) for one in changed]
    refocused = [one for one, is_so in zip(changed, confirmed) if is_so]
    contradicting = [] if moved else contradictions(solution, free.misses)
    scattered = [] if moved else _scattered(solution, contradicting, SCATTERS_PX)
    two = [] if refocused else _two(solution, contradicting, scattered)
    if two or scattered:
        contradicting, scattered = [], [] if two else scattered  # without a rest, nothing contradicts it
    contradicting = completed(solution, contradicting)
    named = sorted((one for one in shared if not one.is_bend), key=lambda one: -one.certainty)[:1]
    lasting = moved or refocused or named or scattered or two
    mixed = [] if lasting or contradicting or shared else groups(free, needed_px)
    focus = {} if lasting or contradicting or mixed else focal_scatter(free, needed_px)
    cause = [] if lasting or solution.task.planes else _scattered(solution, contradicting, 0.0)  # or wrong distances
    reasons = [changes.of_place(one) for one in moved]
    reasons += [changes.of_optics(one, len(solution.task.sensors)) for one in refocused]
    reasons += [*map(str, [*named, *mixed]), *(changes.of_focus(*each) for each in focus.items())]
    reasons += [*map(str, [*two, *scattered]), *_contradicting(contradicting)]
    reasons += [changes.unexplained(one) for one, is_so in zip(changed, confirmed) if not is_so]
    return ShotDoubts(reasons, contradicting, [*map(str, cause)])


def _two(solution: Solution, contradicting: Sequence[Contradiction], scattered: Sequence[Scatter]) -> list[TwoGroups]:
    """Two groups that explain shots which contradict each other, if there are any."""
    free_running = any(sensor.free_running for sensor in solution.task.sensors.values())
    if free_running or not (contradicting or scattered):
        return []
    guesses = [by_residuals(solution), {one.shot for one in contradicting}]
    found = two_groups(solution.task, solution.cameras, guesses)
    apart = [one for one in found if one.other_px > _APART * one.alone_px]
    return [one for one in apart if one.alone_px < _EXPLAINED * typical_alone(solution)]


def _contradicting(found: Sequence[Contradiction]) -> list[str]:
    if not found:
        return []
    count = f"{len(found)} shots contradict" if len(found) > 1 else "one shot contradicts"
    return [
        f"{count} the others: {'; '.join(map(str, found))}. Look at the pictures, and leave out what is wrong: "
        f"--skip {numbered({one.shot for one in found})}"
    ]


def _scattered(solution: Solution, contradicting: Sequence[Contradiction], minimum_px: float) -> list[Scatter]:
    found = scatter(solution, minimum_px)
    if found and contradicting:  # a few wrong shots spoil the others until they are left out
        found = _scatter_without({one.shot for one in contradicting}, solution, minimum_px)
    return found


def _scatter_without(shots: Collection[int], solution: Solution, minimum_px: float) -> list[Scatter]:
    rest = solution.task.of_shots([shot for shot in solution.task.shots if shot not in shots])
    try:
        return scatter(calibrate(rest), minimum_px)
    except ValueError:  # nor can the rest be calibrated
        return scatter(solution, minimum_px)
