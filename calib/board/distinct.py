"""Distinct poses among the views of a board: views of one pose repeat each other, and count once.

Images of a board that is held still, or files that are given twice, share the errors of lens, board and detection at
that place: however many they are, they confirm nothing.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.board.board_pose_features import BoardPose, board_pose_features, extent, moved
from calib.board.views import CornerView, PlaneView

#: A tilt is recognised by the shape of the board in the image, because a board that faces the camera has two tilts that
#: look nearly the same: RMS change relative to the board's radius, 8° to 15°, and in deviations of a corner.
_SHAPE, _DEVIATIONS = 0.015, 3.0

#: Minimum number of corners in common; views of different parts of a board are not compared.
_COMMON = 6

#: Corners of two cameras are this far apart at least [px]: closer, the lenses would be within 0.3 mm of each other with
#: 500 px focal length and a board 0.5 m away.
_SAME_PX = 0.3


@dataclass(frozen=True)
class _Posed:
    """A view, the size of its image, and the features of all its corners."""

    view: CornerView
    size: tuple[int, int]
    features: BoardPose


def distinct_poses(views: Iterable[CornerView], sizes: Mapping[str, tuple[int, int]] | None = None) -> dict[int, int]:
    """Pose of every shot, named by the first shot that shows it.

    Two shots show one pose if a sensor saw the board in both, and none saw a difference. Shots are compared with the
    first one of each pose, so that a board in motion does not remain one pose.

    Args:
        views: corners of all sensors.
        sizes: width and height of each sensor's images [px]; by default of what contains all its corners.
    """
    views = list(views)
    if sizes is None:
        sensors = dict.fromkeys(view.sensor for view in views)
        sizes = {name: extent([view for view in views if view.sensor == name]) for name in sensors}
    shots: dict[int, dict[str, _Posed]] = {}
    for view in views:
        size = sizes[view.sensor]
        shots.setdefault(view.shot, {})[view.sensor] = _Posed(view, size, board_pose_features(view, size))
    poses: dict[int, int] = {}
    for shot, seen in shots.items():
        firsts = [other for other, first in poses.items() if other == first]
        poses[shot] = next((first for first in firsts if _repeats(seen, shots[first])), shot)
    return poses


def is_repeated(view: CornerView, others: Iterable[CornerView], size: tuple[int, int]) -> bool:
    """True if a view of a sensor shows the pose of one of its other views; `size` of its image [px]."""
    posed = _Posed(view, size, board_pose_features(view, size))
    return any(_is_same(posed, _Posed(other, size, board_pose_features(other, size))) for other in others)


def counts_of(views: Sequence[CornerView | PlaneView], poses: Mapping[int, int]) -> dict[str, int]:
    """Number of distinct poses by sensor; `poses` as of `distinct_poses`."""
    seen: dict[str, set[int]] = {}
    for view in views:
        seen.setdefault(view.sensor, set()).add(poses[view.shot])
    return {sensor: len(each) for sensor, each in seen.items()}


def same_images(views: Iterable[CornerView]) -> list[tuple[str, str]]:
    """Pairs of sensors that see the corners in the same places in most shots that both saw.

    Images that were compressed, brightened or smoothed anew have corners that differ by up to 0.17 px; those of two
    cameras differ by more, unless they look through one lens.
    """
    seen: dict[str, dict[int, CornerView]] = {}
    for view in views:
        seen.setdefault(view.sensor, {})[view.shot] = view
    found = []
    for first, second in combinations(seen, 2):
        both = seen[first].keys() & seen[second].keys()
        if both and np.median([_distance_px(seen[first][shot], seen[second][shot]) for shot in both]) < _SAME_PX:
            found.append((first, second))
    return found


def _distance_px(a: CornerView, b: CornerView) -> float:
    """Root mean square distance of the corners that are in both views [px]; infinite without any."""
    rows, others = _common(a.points_b, b.points_b)
    if not rows:
        return float("inf")
    return float(np.sqrt(np.mean(np.sum((a.pixels[rows] - b.pixels[others]) ** 2, axis=1))))


def _repeats(shot: Mapping[str, _Posed], other: Mapping[str, _Posed]) -> bool:
    both = [sensor for sensor in shot if sensor in other]
    return bool(both) and all(_is_same(shot[sensor], other[sensor]) for sensor in both)


def _is_same(a: _Posed, b: _Posed) -> bool:
    if not np.array_equal(a.view.points_b, b.view.points_b):
        rows = _common(a.view.points_b, b.view.points_b)
        if len(rows[0]) < _COMMON:
            return False
        a, b = _part(a, rows[0]), _part(b, rows[1])
    return not (moved(a.features, b.features) or _changes_shape(a.view, b.view))


def _changes_shape(a: CornerView, b: CornerView) -> bool:
    """True if the same corners of two views differ in more than place, size and roll."""
    # As complex numbers: a similarity multiplies them by one number.
    first, second = ((view.pixels - view.pixels.mean(axis=0)) @ np.array([1, 1j]) for view in (a, b))
    misses = second - np.vdot(first, second) / np.vdot(first, first) * first
    change, radius = (float(np.linalg.norm(each) / np.sqrt(len(each))) for each in (misses, second))
    return change > max(_SHAPE * radius, _DEVIATIONS * float(np.hypot(a.sigma_px, b.sigma_px)))


def _common(first: NDArray[np.float64], second: NDArray[np.float64]) -> tuple[list[int], list[int]]:
    """Rows of the points (n, 3) that are in both."""
    rows = {tuple(point): row for row, point in enumerate(first.tolist())}
    pairs = [(rows[tuple(point)], row) for row, point in enumerate(second.tolist()) if tuple(point) in rows]
    return [one for one, _ in pairs], [other for _, other in pairs]


def _part(posed: _Posed, rows: list[int]) -> _Posed:
    view = replace(posed.view, points_b=posed.view.points_b[rows], pixels=posed.view.pixels[rows])
    return _Posed(view, posed.size, board_pose_features(view, posed.size))
