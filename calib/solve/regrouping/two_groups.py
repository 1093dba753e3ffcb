"""Two groups of shots, by two means: each is solved anew, and each shot goes to the one that explains it better."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.solve.bundle.tasks import Task
from calib.solve.regrouping.refits import corners_alone, fitted, misses, with_held_lenses
from calib.solve.rounding import rounded

#: Minimum number of shots in a group, and largest number of times that all shots are assigned.
_MEMBERS, _STEPS = 3, 8

#: A group is one if its shots miss by at most this many times what the shots of the other miss by.
_ALIKE = 2.0

#: Shots that miss by this many times the median of those that are left, and by this much [px], are not explained.
_FAR, _FAR_PX = 3.0, 0.5

#: From this ratio of their sizes on, neither of two groups is the exception.
_EQUAL = 0.6


@dataclass(frozen=True)
class TwoGroups:
    """Two groups of shots, each of which has cameras that explain it.

    Attributes:
        smaller, larger: their shots.
        alone_px: median over the shots of how far corners miss with the cameras of their own group [px].
        other_px: and with those of the other group.
        exchanged: two sensors whose images are those of each other in one of the groups; empty if none are.
    """

    smaller: tuple[int, ...]
    larger: tuple[int, ...]
    alone_px: float
    other_px: float
    exchanged: tuple[str, ...] = ()

    @property
    def advice(self) -> str:
        """Advice: shots to leave out or to mend; of groups that are about as large, either."""
        smaller = numbered(self.smaller)
        if self.exchanged:
            return (
                f"The images of {' and '.join(self.exchanged)} were exchanged in one of both groups, as then one rig "
                f"explains all: exchange them back in shots {smaller}, or leave these out: --skip {smaller}"
            )
        if len(self.smaller) <= _EQUAL * len(self.larger):
            return f"Look at both groups, and leave one out: --skip {smaller}"
        return (
            "One of both groups is wrong, and nothing says which: look at both, and leave one out, "
            f"--skip {smaller} or --skip {numbered(self.larger)}"
        )

    def __str__(self) -> str:
        """The finding, and what to do."""
        is_open = ": was a sensor moved, turned or zoomed between them, or are their images paired otherwise? "
        return (
            f"two groups of shots contradict each other: {numbered(self.smaller)} and {numbered(self.larger)}. With "
            f"cameras of its own each misses by {rounded(self.alone_px)} px, with those of the other by "
            f"{rounded(self.other_px)} px{'. ' if self.exchanged else is_open}{self.advice}"
        )


def numbered(shots: Collection[int]) -> str:
    """Shots as `--skip` takes them: 3,7-9."""
    first = sorted(shot for shot in shots if shot - 1 not in shots)
    last = sorted(shot for shot in shots if shot + 1 not in shots)
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in zip(first, last, strict=True))


def two_groups(task: Task, cameras: Mapping[str, Camera], guesses: Iterable[Collection[int]]) -> list[TwoGroups]:
    """Two groups that explain all shots best, from guesses of the shots of one of them; empty if none do.

    Args:
        task: with all shots.
        cameras: whose lenses are held.
        guesses: any; the first that most shots agree with need not be the best.
    """
    held = with_held_lenses(corners_alone(task, cameras))
    found = [one for guess in guesses for one in _settled(held, np.isin(held.shots, [*guess]))]
    return sorted(found, key=lambda one: one.alone_px)[:1]


def _settled(held: Task, members: NDArray[np.bool_]) -> list[TwoGroups]:
    for _ in range(_STEPS):
        if not _MEMBERS <= members.sum() <= len(members) - _MEMBERS:
            return []
        try:
            cameras = [fitted(held, _part(held, part)) for part in (~members, members)]
        except ValueError:  # nothing explains one of them
            return []
        off = np.stack([misses(held, each) for each in cameras])
        before, members = members, off[1] < off[0]
        if np.array_equal(before, members):
            return _judged(held, members, cameras, off)
    return []


def _judged(
    held: Task, members: NDArray[np.bool_], cameras: Sequence[Mapping[str, Camera]], off: NDArray[np.float64]
) -> list[TwoGroups]:
    """The groups, if both are explained alike or by exchanged images, by what shots miss with the cameras of both.

    Args:
        held: with all shots.
        members: shots of one of the groups (shots,).
        cameras: that explain the others, and these.
        off: what corners miss by with both, root mean square (2, shots) [px].
    """
    own, other = off.min(axis=0), off.max(axis=0)
    smaller, larger = sorted((tuple(_part(held, part)) for part in (members, ~members)), key=len)
    found = TwoGroups(smaller, larger, float(np.median(own)), float(np.median(other)))
    # Lenses that were begun with exchanged images are those of neither sensor, and fit neither group well.
    if exchanged := _exchanged(held, found, cameras[int(2 * members.sum() > len(members))]):
        return [replace(found, exchanged=exchanged)]
    typical = sorted(float(np.median(own[part])) for part in (members, ~members))
    return [] if typical[1] > _ALIKE * typical[0] else [found]


def _exchanged(held: Task, found: TwoGroups, cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """Two sensors of one size whose images in the smaller group, once exchanged, cameras of the larger one explain."""
    sizes = {name: (sensor.width, sensor.height) for name, sensor in held.sensors.items()}
    pairs = [(one, other) for one, other in combinations(sorted(sizes), 2) if sizes[one] == sizes[other]]
    rest = held.of_shots(found.smaller)
    for one, other in pairs:
        views = [view.renamed({one: other, other: one}) for view in rest.corners]
        off = float(np.median(misses(replace(rest, corners=views), cameras)))
        if _FAR * off < found.other_px and off < max(_FAR * found.alone_px, _FAR_PX):
            return one, other
    return ()


def _part(held: Task, members: NDArray[np.bool_]) -> Sequence[int]:
    return np.compress(members, held.shots).tolist()


def unexplained(task: Task, cameras: Mapping[str, Camera], odd: Collection[int]) -> dict[int, float]:
    """Shots that cameras fitted without them do not explain, with what their corners miss by [px].

    Args:
        task: with all shots.
        cameras: to begin with.
        odd: these shots, about.
    """
    corners = corners_alone(task, cameras)
    far, found = {*odd}, dict.fromkeys(odd, 0.0)
    for _ in range(_STEPS):
        rest = [shot for shot in corners.shots if shot not in far]
        try:
            off = dict(zip(corners.shots, misses(corners, fitted(corners, rest)).tolist(), strict=True))
        except ValueError:  # nothing explains the rest
            return found
        minimum = max(_FAR * float(np.median([off[shot] for shot in rest])), _FAR_PX)
        before, found = far, {shot: miss for shot, miss in off.items() if miss > minimum}
        far = {*found}
        if far == before:
            break
    return found
