"""Mistakes in the images of a check, which look like a rig that changed: exchanged, repeated, mirrored, turned.

Each is undone in turn. The board of a shot is placed by one sensor and looked for in the others, with the stored rig: a
mistake is named if the images fit without it, and by far not with it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from itertools import combinations, product

import numpy as np

from calib import pose
from calib.board.distinct import same_images
from calib.board.views import CornerView
from calib.calibration_check.sensor_fits import corner_fit
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.start.board_poses import pose_candidates

#: Maximum number of shots that are looked at, of those that several sensors saw.
MAX_SHOTS = 10

#: Corners that miss by less than this share of the image's width are no mistake. Without the mistake they do, and miss
#: this many times less.
MIN_SHARE, BETTER = 0.005, 5.0

#: Corners that miss by this many times less with the camera of another sensor are probably of that one.
LIKELIER = 1.5

#: Explanations within this factor of the best one cannot be told from it.
ALIKE = 2.0

#: Axes that are reversed: none, x, y, both.
_FLIPS = ((0, 0), (1, 0), (0, 1), (1, 1))

Shots = list[list[CornerView]]


class Kind(Enum):
    """Kinds of mistake."""

    EXCHANGED = "exchanged"
    REPEATED = "the same"
    MIRRORED = "mirrored"
    TURNED = "turned by 180°"


@dataclass(frozen=True)
class Mistake:
    """Mistake that explains images which do not fit the stored rig.

    Attributes:
        kind: of mistake.
        sensors: two that were exchanged or have the same images, otherwise one, or all.
        given_px: median by which the corners of a shot miss, as given [px].
        undone_px: likewise, without the mistake; NaN for images that are the same [px].
    """

    kind: Kind
    sensors: tuple[str, ...]
    given_px: float
    undone_px: float


def find(stored: Stored, corners: Sequence[CornerView]) -> list[Mistake]:
    """Mistakes of which each would explain the images, the best first; empty if the images fit, or none does."""
    shots = _shared(corners)
    given = _miss(stored, shots)
    there = {view.sensor for views in shots for view in views}
    names = [name for name in stored.sensors if name in there]
    minimum = MIN_SHARE * max((stored.sensors[name].camera.width for name in names), default=0)
    if given <= minimum:
        return []
    if same := same_images(view for views in shots for view in views):
        return [Mistake(Kind.REPEATED, pair, given, float("nan")) for pair in same]
    found: dict[tuple[Kind, tuple[str, ...]], float] = {}
    for key, undone in _undone(stored, shots, names):
        found[key] = min(_miss(stored, undone), found.get(key, np.inf))
    best = min(found.values(), default=np.inf)
    likely = sorted(found, key=lambda key: found[key]) if best < min(minimum, given / BETTER) else []
    return [Mistake(*key, given, found[key]) for key in likely if found[key] < ALIKE * best]


def likelier(stored: Stored, views: Views, sensor: str) -> str:
    """Another sensor whose camera fits the corners that a sensor saw by far better; "" if there is none."""
    given, own = stored.sensors[sensor].camera, [view for view in views.corners if view.sensor == sensor]
    misses = {sensor: corner_fit(stored, views, sensor).rms}
    for name, other in stored.sensors.items():
        taken = [replace(view, sensor=name) for view in own]
        is_like = (other.camera.width, other.camera.height) == (given.width, given.height)
        if name != sensor and is_like and all(pose_candidates(other.camera, view) for view in taken):
            misses[name] = corner_fit(stored, Views(taken, ()), name).rms
    best = min(misses, key=lambda name: misses[name])
    return best if misses[best] * LIKELIER < misses[sensor] else ""


def _shared(corners: Sequence[CornerView]) -> Shots:
    """Views of evenly spread shots that several sensors saw."""
    by_shot: dict[int, list[CornerView]] = {}
    for view in corners:
        by_shot.setdefault(view.shot, []).append(view)
    shared = [views for views in by_shot.values() if len(views) > 1]
    return [shared[k] for k in np.unique(np.linspace(0, len(shared) - 1, min(MAX_SHOTS, len(shared))).astype(int))]


def _miss(stored: Stored, shots: Shots) -> float:
    """Median over the shots of the root mean square by which corners miss, with the board where it fits best [px]."""
    found = []
    for views in shots:
        cameras = [stored.sensors[view.sensor].camera for view in views]
        boards = [
            c.T_rs @ each.T_sb for c, view in zip(cameras, views, strict=True) for each in pose_candidates(c, view)
        ]
        squares = [
            np.mean(
                [
                    np.mean(np.sum((c.project(pose.transform(T_rb, v.points_b)) - v.pixels) ** 2, axis=1))
                    for c, v in zip(cameras, views, strict=True)
                ]
            )
            for T_rb in boards
        ]
        found.append(np.sqrt(np.min(np.nan_to_num(squares, nan=np.inf), initial=np.inf)))
    return float(np.median(found)) if found else 0.0


def _undone(stored: Stored, shots: Shots, names: Sequence[str]) -> Iterator[tuple[tuple[Kind, tuple[str, ...]], Shots]]:
    """Shots without each mistake."""
    sizes = {name: (stored.sensors[name].camera.width, stored.sensors[name].camera.height) for name in names}
    for a, b in combinations(names, 2):
        if sizes[a] == sizes[b]:
            yield (Kind.EXCHANGED, (a, b)), _each(shots, partial(CornerView.renamed, to={a: b, b: a}))
    extent = np.max([view.points_b.max(axis=0) for views in shots for view in views], axis=0)[:2]
    for group, image, board in product([*((name,) for name in names), tuple(names)], _FLIPS[1:], _FLIPS):
        # A mirrored board is numbered from another corner, and a turned one from the other end if its ends look alike.
        if sum(image) % 2 == sum(board) % 2:
            kind = Kind.MIRRORED if sum(image) % 2 else Kind.TURNED
            own, along = {name: sizes[name] for name in group}, tuple(np.multiply(board, extent).tolist())
            yield (kind, group), _each(shots, partial(_flipped, sizes=own, image=image, board=along))


def _flipped(
    view: CornerView, sizes: Mapping[str, tuple[int, int]], image: tuple[int, int], board: tuple[float, float]
) -> CornerView:
    """View with reversed axes, of a sensor without a size as it is.

    Args:
        view: as given.
        sizes: of the images, by sensor [px].
        image: axes of the images that are reversed.
        board: extent of the board along the axes that are reversed [m], otherwise 0.
    """
    if view.sensor not in sizes:
        return view
    pixels = np.where(image, np.array(sizes[view.sensor]) - 1 - view.pixels, view.pixels)
    points_b = view.points_b.copy()
    points_b[:, :2] = np.where(board, board - points_b[:, :2], points_b[:, :2])
    return replace(view, pixels=pixels, points_b=points_b)


def _each(shots: Shots, change: Callable[[CornerView], CornerView]) -> Shots:
    return [[change(view) for view in views] for views in shots]
