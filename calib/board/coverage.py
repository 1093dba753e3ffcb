"""Whether a set of views is enough for a calibration, and in words what is missing."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.board import mirrored
from calib.board.board_pose_features import Stance, differs, extent, stance
from calib.views import CornerView

#: Views of a sensor below which no calibration is attempted, and with which one is reliable.
LEAST_VIEWS, ENOUGH_VIEWS = 4, 12
#: Moments at which two sensors have to see the board together for their poses to be told well.
ENOUGH_SHARED = 6
#: Angle that the board should be tilted by in each of the four directions [rad].
ENOUGH_TILT = np.deg2rad(18)
#: Part of the image's width or height that the largest view should fill, and how much smaller the smallest should be.
ENOUGH_SIZE, ENOUGH_DEPTH = 0.4, 0.8

#: Points with which a ninth of the image counts as seen.
LEAST_POINTS = 6

_PLACES = (
    ("top left corner", "top edge", "top right corner"),
    ("left edge", "middle", "right edge"),
    ("bottom left corner", "bottom edge", "bottom right corner"),
)


class TooFewViewsError(ValueError):
    """A sensor saw the board too few times."""


class ViewsAlikeError(ValueError):
    """All views of a sensor show the board in nearly the same pose, so that they are as good as one."""


@dataclass(frozen=True, slots=True)
class Wish:
    """What one more view should show.

    Attributes:
        sensor: to which sensor.
        text: a sentence for who holds the board.
    """

    sensor: str
    text: str


def check(views: Iterable[CornerView]) -> None:
    """Refuses a set of views of which no calibration can be made.

    Raises:
        TooFewViewsError, ViewsAlikeError, MirroredSensorError: names the sensor and what to do.
    """
    views = list(views)
    for sensor, seen in by_sensor(views).items():
        if len(seen) < LEAST_VIEWS:
            raise TooFewViewsError(
                f"{sensor}: {len(seen)} view{'s' * (len(seen) != 1)} of the board, but a calibration needs "
                f"{LEAST_VIEWS} at the very least and {ENOUGH_VIEWS} to be reliable"
            )
        stances = [stance(view, extent(seen)) for view in seen]
        if not any(differs(a, b) for a, b in combinations(stances, 2)):
            raise ViewsAlikeError(
                f"{sensor}: all {len(seen)} views show the board in nearly the same pose, and so are as good as one. "
                "Tilt it to all four sides by 20° to 40°, hold it near and far, and into the corners of the image"
            )
    mirrored.check(views)


def wishes(views: Sequence[CornerView], sizes: Mapping[str, tuple[int, int]]) -> list[Wish]:
    """What is missing, the most important first; empty if the views are enough.

    Args:
        views: all that were kept.
        sizes: width and height of each sensor's images [px]; a sensor without any view is one of them, too.
    """
    seen = by_sensor(views)
    found = [wish for sensor, size in sizes.items() for wish in _of_sensor(sensor, size, seen.get(sensor, []))]
    for first, second in combinations(sizes, 2):
        shared = {v.shot for v in seen.get(first, [])} & {v.shot for v in seen.get(second, [])}
        if seen.get(first) and seen.get(second) and len(shared) < ENOUGH_SHARED:
            text = f"show the board to {first} and {second} at the same time ({len(shared)} of {ENOUGH_SHARED} times)"
            found.append(Wish(second, text))
    return found


def counts(views: Sequence[CornerView], size: tuple[int, int], columns: int, rows: int) -> NDArray[np.intp]:
    """How many points were seen in each cell (rows, columns) of a grid over the image of width and height `size`."""
    pixels = np.concatenate([np.zeros((0, 2)), *(view.pixels for view in views)])
    edges = [np.linspace(-0.5, size[axis] - 0.5, number + 1) for axis, number in ((1, rows), (0, columns))]
    return np.histogram2d(pixels[:, 1], pixels[:, 0], bins=edges)[0].astype(np.intp)


def adds(view: CornerView, kept: Sequence[CornerView], size: tuple[int, int]) -> bool:
    """Whether a view shows something that the kept views of its sensor do not: another pose, or a part of the image."""
    own = [other for other in kept if other.sensor == view.sensor]
    new = stance(view, size)
    if all(differs(new, stance(other, size)) for other in own):
        return True
    seen = counts(own, size, 3, 3)
    more = seen + counts([view], size, 3, 3)
    return bool(((seen < LEAST_POINTS) & (more >= LEAST_POINTS)).any())


def by_sensor(views: Iterable[CornerView]) -> dict[str, list[CornerView]]:
    """The views of each sensor, by its name."""
    found: dict[str, list[CornerView]] = {}
    for view in views:
        found.setdefault(view.sensor, []).append(view)
    return found


def _of_sensor(sensor: str, size: tuple[int, int], views: Sequence[CornerView]) -> list[Wish]:
    if not views:
        return [Wish(sensor, f"show the board to {sensor}: it has not seen it yet")]
    stances = [stance(view, size) for view in views]
    texts = _tilts(stances) + _distances(stances) + _places(sensor, size, views)
    if not texts and len(views) < ENOUGH_VIEWS:
        texts = [f"show more poses to {sensor} ({len(views)} of {ENOUGH_VIEWS})"]
    return [Wish(sensor, text) for text in texts]


def _tilts(stances: Sequence[Stance]) -> list[str]:
    across, along = np.array([one.tilt for one in stances]).T
    missing = {
        "left": across.min() > -ENOUGH_TILT,
        "right": across.max() < ENOUGH_TILT,
        "up": along.min() > -ENOUGH_TILT,
        "down": along.max() < ENOUGH_TILT,
    }
    return [f"tilt the board more: let it face {way}" for way, is_missing in missing.items() if is_missing]


def _distances(stances: Sequence[Stance]) -> list[str]:
    sizes = [one.size for one in stances]
    if max(sizes) < ENOUGH_SIZE:
        return ["come closer"]
    return ["go further away"] if min(sizes) > ENOUGH_DEPTH * max(sizes) else []


def _places(sensor: str, size: tuple[int, int], views: Sequence[CornerView]) -> list[str]:
    seen = counts(views, size, 3, 3)
    return [
        f"nobody has seen the {_PLACES[row][column]} of {sensor}"
        for row, column in np.ndindex(seen.shape)
        if seen[row, column] < LEAST_POINTS
    ]
