"""Sensors that did not stay as they were: refocused, zoomed or moved between shots.

Such shots are explained by something in between, with small residuals, and halves that take every other pose agree.
Each distinct pose pulls the solution with its own score (see `calib.solve.bundle.uncertainty`). A change at one time is
the split of the poses in their order that disagrees most, beyond any split of the same poses in random order: errors of
lens and board, which also disagree, have no order. A focal length that is another one in each shot makes the poses
disagree about it more than about everything else.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calib import pose
from calib.solve.bundle.parameters.layout import POSE, turned
from calib.solve.bundle.uncertainty import scaled_inverse
from calib.solve.solution import Solution
from calib.solve.validation.free_shape import DistinctPoses, FreeShape, along, disagreement, once, without
from calib.solve.validation.support import from_middle

#: Minimum number of distinct poses before and after a change.
MIN_POSES = 4

#: Random orders of the poses, the share of them that may disagree as much, and the factor by which the change disagrees
#: more than any order of the poses without it.
ORDERS, RIVALS, MARGIN = 499, 0.01, 1.2

#: One of the values that change does so by this many deviations.
DEVIATIONS = 4.0

#: Probability that noise alone makes one split disagree less.
CERTAIN = 1 - 1e-5

#: Probability that a change is named, of one that is said to show, and minimum number of poses to say so.
SHOWN, POSES_TO_SHOW = 0.9, 12

#: Changes below this share of the required accuracy of projections are harmless.
HARMLESS = 0.5

#: Squared deviations that a split explains of each pose, as the poses disagree; real sets have 1.0 at most.
GAIN = 2.0

#: Ratio of the disagreement about the focal length to that about all parameters, from which on it is not steady: real
#: sets have 3.3 at most (nine poses, 4096 pixels), the others 2.1. Beyond the largest deviation the shots say nothing
#: of the focal length.
UNSTEADY, MAX_DEVIATION = 3.5, 0.1

#: Share of the information, by which what some poses do not show at all is kept from dividing by zero.
_UNSEEN = 1e-9

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """A sensor that is another one from a shot on.

    Attributes:
        sensor: its name.
        shot: the first shot after the change.
        values: change of the focal length [1] and of cx and cy [px], or increments of the pose (6,) [rad, m].
        shift_px: root mean square displacement of the corners [px].
    """

    sensor: str
    shot: int
    values: Array
    shift_px: float


def changes_of_optics(free: FreeShape, needed_px: float) -> list[Change]:
    """Sensors whose focal length or principal point changed, by at least half of `needed_px` [px] in the image."""
    found = []
    for name, directions in optics(free):
        if split := _split(free, directions):
            shift = rms(split.values[0] * from_middle(free.solution, name) + split.values[1:])
            found.append(Change(name, split.shot, split.values, shift))
    return [one for one in found if one.shift_px > HARMLESS * needed_px]


def changes_of_place(free: FreeShape, needed_px: float) -> list[Change]:
    """Sensors that moved relative to the reference, by at least half of `needed_px` [px] in the image."""
    layout, found = free.solution.adjustment.layout, []
    for name, own in layout.free_parameters.items():
        if own.moves and not own.free_running:
            directions = np.eye(free.size)[:, layout.columns(name, POSE)]
            if split := _split(free, directions):
                shift = rms(_moved(free.solution, name, split.values))
                found.append(Change(name, split.shot, split.values, shift))
    return [one for one in found if one.shift_px > HARMLESS * needed_px]


def focal_scatter(free: FreeShape, needed_px: float) -> dict[str, float]:
    """Deviation of the focal length from shot to shot [1], of the sensors in which it is not steady."""
    found = {}
    for name, directions in optics(free):
        information, scores = once(free.poses)
        if len(scores) < 2 * MIN_POSES:
            continue
        focal = of_focal(information, free.poses.prior, scores, directions[:, 0])
        harm = focal.deviation * from_middle_px(free.solution, name)
        if focal.ratio > UNSTEADY and focal.deviation < MAX_DEVIATION and harm > HARMLESS * needed_px:
            found[name] = focal.deviation
    return found


def unseen_change(free: FreeShape) -> dict[str, float]:
    """Least change of the focal length half way [1] that would have shown, by sensor; infinite with too few poses.

    Of simulated cameras with a dozen poses and more, nine of ten that changed by this much are named.
    """
    information, scores = once(free.poses)
    order = np.argsort(np.unique(free.solution.adjustment.equations.poses, return_index=True)[1])
    first, found = order[: len(order) // 2], {}
    for name, directions in optics(free):
        if len(order) < POSES_TO_SHOW:
            found[name] = np.inf
            continue
        known = along(directions, information, free.poses.prior)
        together = known.whole[first].sum(axis=0)[:, 0]
        curvature = float(known.own[first].sum(axis=0)[0, 0] - together @ together)
        deviations = np.sqrt(_least(free, directions, disagreement(information, scores))) + stats.norm.ppf(SHOWN)
        found[name] = float(deviations / np.sqrt(max(curvature, 1e-12)))
    return found


def _least(free: FreeShape, directions: Array, left: float) -> float:
    """Misfit [deviations²] from which on a change along directions (k, m) is named; `left`: see `disagreement`."""
    certain = free.inflation * stats.chi2.ppf(CERTAIN, directions.shape[1])
    return max(float(certain), GAIN * len(free.poses.scores) * left)


class FocalScatter(NamedTuple):
    """Disagreement of poses about the focal length, relative to that about all else, and its deviation [1]."""

    ratio: float
    deviation: float


def of_focal(information: Array, prior: Array, scores: Array, focal: Array) -> FocalScatter:
    """Disagreement of poses about the focal length, a direction (k,)."""
    taken = scaled_inverse(information.sum(axis=0) + prior)
    own = information - information @ taken @ information
    weights = np.maximum(focal @ own @ focal, 1e-12)
    ratio = float(np.mean((scores @ focal) ** 2 / weights)) / disagreement(own, scores)
    estimates = scores @ focal / weights
    middle = np.average(estimates, weights=weights)
    excess = float(np.sum(weights * (estimates - middle) ** 2)) - (len(scores) - 1)
    variance = excess / (weights.sum() - float(np.sum(weights**2)) / weights.sum())
    return FocalScatter(ratio, float(np.sqrt(max(variance, 0.0))))


def optics(free: FreeShape) -> Iterator[tuple[str, Array]]:
    """Sensors with a free focal length, and directions (k, 1 to 3) of it (relative) and of cx and cy."""
    layout = free.solution.adjustment.layout
    for name, own in layout.free_parameters.items():
        if {"fx", "cx", "cy"} <= {*own.intrinsics}:
            directions = np.zeros((free.size, 3))
            for key, column in (("fx", 0), ("fy", 0), ("cx", 1), ("cy", 2)):
                if key in own.intrinsics:
                    size = getattr(free.solution.cameras[name], key) if column == 0 else 1.0
                    directions[layout.columns(name, [key]), column] = size
            yield name, directions


class _Found(NamedTuple):
    """First shot after a change, and its size (m,)."""

    shot: int
    values: Array


def _split(free: FreeShape, directions: Array) -> _Found | None:
    """Change along directions (k, m); None if there is none."""
    adjustment = free.solution.adjustment
    numbers, first = np.unique(adjustment.equations.poses, return_index=True)
    if len(numbers) < 2 * MIN_POSES:
        return None
    order = np.argsort(first)
    poses = DistinctPoses(*(part[order] for part in once(free.poses)))
    known = along(directions, poses.information, free.poses.prior)
    own, whole, pulls = known.own, known.whole, poses.scores @ directions
    best = _best(own, whole, pulls)
    after = np.arange(len(own)) >= best.first
    is_certain = np.any(np.abs(best.size) > DEVIATIONS * np.sqrt(free.inflation) * best.sigma)
    left = disagreement(poses.information, without(poses, known, after, -best.size))
    if not is_certain or best.misfit < _least(free, directions, left):
        return None
    unchanged = pulls + after[:, None] * (own @ best.size) - whole.transpose(0, 2, 1) @ whole[after].sum(0) @ best.size
    random, rivals = np.random.default_rng(0), 0
    for _ in range(ORDERS):
        shuffled = random.permutation(len(own))
        parts = own[shuffled], whole[shuffled]
        rivals += _best(*parts, pulls[shuffled]).misfit >= best.misfit
        if rivals > RIVALS * ORDERS or MARGIN * _best(*parts, unchanged[shuffled]).misfit >= best.misfit:
            return None
    return _Found(int(adjustment.layout.shots[np.sort(first)[best.first]]), best.size)


@dataclass(frozen=True)
class _Split:
    """The split that disagrees most: squared distance of the parts in deviations, first pose after it, and the change.

    Attributes:
        size, sigma: of the change (m,).
    """

    misfit: float
    first: int
    size: Array
    sigma: Array


def _best(own: Array, whole: Array, pulls: Array) -> _Split:
    """The best split, by the information (poses, m, m), its root from all (poses, k, m), and the pulls (poses, m)."""
    before, together, pull = (np.cumsum(part, axis=0)[MIN_POSES - 1 : -MIN_POSES] for part in (own, whole, pulls))
    curvature = before - together.transpose(0, 2, 1) @ together
    curvature += _UNSEEN * np.diag(own.sum(axis=0).diagonal() + _UNSEEN)
    # Of all poses the pulls cancel, so that those after the split are the opposite of those before.
    sizes = np.linalg.solve(curvature, pull[:, :, None])[:, :, 0]
    squares = np.sum(sizes * pull, axis=1)
    best = int(np.argmax(squares))
    variances = np.linalg.inv(curvature[best]).diagonal()
    return _Split(float(squares[best]), best + MIN_POSES, sizes[best], np.sqrt(np.maximum(variances, 0)))


def from_middle_px(solution: Solution, name: str) -> float:
    """Root mean square distance of a sensor's corners from its principal point [px]."""
    return rms(from_middle(solution, name))


def _moved(solution: Solution, name: str, values: Array) -> Array:
    """Displacements of a sensor's corners (n, 2) [px] by increments of its pose (6,)."""
    camera = solution.cameras[name]
    after = replace(camera, T_rs=turned(camera.T_rs, values))
    views = [view for view in solution.task.corners if view.sensor == name and view.shot in solution.boards]
    if not views:
        return np.zeros((1, 2))
    points = np.concatenate([pose.transform(solution.boards[view.shot], view.points_b) for view in views])
    return after.project(points) - camera.project(points)


def rms(displacements: Array) -> float:
    """Root mean square length of displacements (n, 2), without those that are not finite."""
    squares = np.sum(displacements**2, axis=1)
    return float(np.sqrt(np.mean(squares[np.isfinite(squares)])))
