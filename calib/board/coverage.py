"""Coverage of a set of views: sufficiency for a calibration, and instructions for missing views."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.board import mirrored
from calib.board.board_pose_features import BoardPose, board_pose_features
from calib.board.distinct import distinct_poses, is_repeated, same_images
from calib.board.views import CornerView

#: Minimum number of distinct poses before a sensor, and number for a reliable calibration.
MIN_VIEWS, SUFFICIENT_VIEWS = 4, 12
#: Number of distinct poses before both for a reliable relative pose of two sensors.
SUFFICIENT_SHARED = 6
#: Required tilt of the board in each of the four directions [rad].
SUFFICIENT_TILT = np.deg2rad(18)
#: Required size of the largest view relative to the image, and required ratio of smallest to largest.
SUFFICIENT_SIZE, SUFFICIENT_DEPTH = 0.4, 0.8

#: Number of points with which a ninth of the image is covered.
MIN_POINTS = 6

_PLACES = (
    ("top left corner", "top edge", "top right corner"),
    ("left edge", "middle", "right edge"),
    ("bottom left corner", "bottom edge", "bottom right corner"),
)


class TooFewViewsError(ValueError):
    """Too few views of a sensor."""


class ViewsAlikeError(ValueError):
    """All views of a sensor show the board in nearly the same pose."""


class SameImagesError(ValueError):
    """The images of one sensor, given for two."""


@dataclass(frozen=True, slots=True)
class MissingView:
    """Instruction for a missing view."""

    sensor: str
    text: str


def check(views: Iterable[CornerView]) -> None:
    """Checks a set of views for a minimum of number and variety.

    Raises:
        TooFewViewsError, ViewsAlikeError, MirroredSensorError, SameImagesError: names the sensor and the remedy.
    """
    views = list(views)
    for sensor, seen in by_sensor(views).items():
        count = len(set(distinct_poses(seen).values()))
        if count == 1 and len(seen) >= MIN_VIEWS:
            raise ViewsAlikeError(
                f"{sensor}: all {len(seen)} views show the board in nearly the same pose, and so are as good as one. "
                "Tilt it to all four sides by 20° to 40°, hold it near and far, and into the corners of the image"
            )
        if count < MIN_VIEWS:
            raise TooFewViewsError(
                f"{sensor}: {len(seen)} view{'s' * (len(seen) != 1)} of {count} distinct "
                f"pose{'s' * (count != 1)} of the board, but a calibration needs {MIN_VIEWS} at the very least and "
                f"{SUFFICIENT_VIEWS} to be reliable"
            )
    for first, second in same_images(views):
        raise SameImagesError(f"{first} and {second} have the same images: give each sensor its own images")
    mirrored.check(views)


def missing_views(views: Sequence[CornerView], sizes: Mapping[str, tuple[int, int]]) -> list[MissingView]:
    """Missing views, the most important first; empty if the views are sufficient.

    Args:
        views: all accepted views.
        sizes: width and height of each sensor's images [px], including sensors without views.
    """
    seen = by_sensor(views)
    found = [view for sensor, size in sizes.items() for view in _of_sensor(sensor, size, seen.get(sensor, []))]
    poses = distinct_poses(views, sizes)
    for first, second in combinations(sizes, 2):
        both = {v.shot for v in seen.get(first, [])} & {v.shot for v in seen.get(second, [])}
        shared = {poses[shot] for shot in both}
        if seen.get(first) and seen.get(second) and len(shared) < SUFFICIENT_SHARED:
            text = (
                f"show the board to {first} and {second} at the same time ({len(shared)} of {SUFFICIENT_SHARED} times)"
            )
            found.append(MissingView(second, text))
    return found


def counts(views: Sequence[CornerView], size: tuple[int, int], columns: int, rows: int) -> NDArray[np.intp]:
    """Number of points in each cell (rows, columns) of a grid over the image of width and height `size`."""
    pixels = np.concatenate([np.zeros((0, 2)), *(view.pixels for view in views)])
    edges = [np.linspace(-0.5, size[axis] - 0.5, number + 1) for axis, number in ((1, rows), (0, columns))]
    return np.histogram2d(pixels[:, 1], pixels[:, 0], bins=edges)[0].astype(np.intp)


def adds_information(view: CornerView, kept: Sequence[CornerView], size: tuple[int, int]) -> bool:
    """True if a view adds a new pose, or covers a new part of the image."""
    own = [other for other in kept if other.sensor == view.sensor]
    if not is_repeated(view, own, size):
        return True
    seen = counts(own, size, 3, 3)
    more = seen + counts([view], size, 3, 3)
    return bool(((seen < MIN_POINTS) & (more >= MIN_POINTS)).any())


def by_sensor(views: Iterable[CornerView]) -> dict[str, list[CornerView]]:
    """Views by sensor."""
    found: dict[str, list[CornerView]] = {}
    for view in views:
        found.setdefault(view.sensor, []).append(view)
    return found


def _of_sensor(sensor: str, size: tuple[int, int], views: Sequence[CornerView]) -> list[MissingView]:
    if not views:
        return [MissingView(sensor, f"show the board to {sensor}: it has not seen it yet")]
    features = [board_pose_features(view, size) for view in views]
    texts = _tilts(features) + _distances(features) + _places(sensor, size, views)
    count = len(set(distinct_poses(views, {sensor: size}).values()))
    if not texts and count < SUFFICIENT_VIEWS:
        texts = [f"show more poses to {sensor} ({count} of {SUFFICIENT_VIEWS})"]
    return [MissingView(sensor, text) for text in texts]


def _tilts(features: Sequence[BoardPose]) -> list[str]:
    across, along = np.array([one.tilt for one in features]).T
    missing = {
        "left": across.min() > -SUFFICIENT_TILT,
        "right": across.max() < SUFFICIENT_TILT,
        "up": along.min() > -SUFFICIENT_TILT,
        "down": along.max() < SUFFICIENT_TILT,
    }
    return [f"tilt the board more: let it face {way}" for way, is_missing in missing.items() if is_missing]


def _distances(features: Sequence[BoardPose]) -> list[str]:
    sizes = [one.size for one in features]
    if max(sizes) < SUFFICIENT_SIZE:
        return ["come closer"]
    return ["go further away"] if min(sizes) > SUFFICIENT_DEPTH * max(sizes) else []


def _places(sensor: str, size: tuple[int, int], views: Sequence[CornerView]) -> list[str]:
    seen = counts(views, size, 3, 3)
    return [
        f"nobody has seen the {_PLACES[row][column]} of {sensor}"
        for row, column in np.ndindex(seen.shape)
        if seen[row, column] < MIN_POINTS
    ]
