"""Relative motion of pairs of sensors since the calibration, with its significance."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats

from calib import pose
from calib.calibration_check.board_poses import formulation, solve
from calib.calibration_check.stored_calibration import Stored, Views
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.bundle import rotations
from calib.solve.bundle.adjustment import Adjustment, NotSolvedError
from calib.solve.bundle.parameters.layout import POSE
from calib.solve.solution import Solution
from calib.solve.validation.free_shape import free_shape
from calib.solve.validation.inconsistent_shots.contradictions import Contradiction, contradictions
from calib.solve.validation.inconsistent_shots.steadiness import Change, changes_of_place

#: Minimum number of common shots of two sensors.
MIN_SHOTS = 3

#: Accuracy of projections that a motion between shots spoils if it shifts pictures by half of this [px].
NEEDED_PX = 1.0

#: Threshold of significance: exceeded by chance in one check of a thousand.
QUANTILE = float(stats.chi2.ppf(0.999, 6))


@dataclass(frozen=True)
class PairChange:
    """Motion of a sensor relative to another since the calibration.

    Attributes:
        first, second: the sensors.
        shots: number of common shots.
        turn: rotation vector about the rig's axes (3,) [rad].
        move: translation (3,) [m].
        shift_px: resulting shift in the second sensor's image [px], root mean square.
        sigma_px: standard deviation of that shift, from the stored and the new covariance [px].
        squared: squared Mahalanobis distance of turn and move; chi-squared with 6 degrees of freedom without motion.
        contradicting: shots that contradict the others and were left out.
        during: motion between these shots, from one of them on; empty, or one.
    """

    first: str
    second: str
    shots: int
    turn: NDArray[np.float64]
    move: NDArray[np.float64]
    shift_px: float
    sigma_px: float
    squared: float
    contradicting: tuple[Contradiction, ...] = ()
    during: tuple[Change, ...] = ()

    @property
    def is_significant(self) -> bool:
        """True if the motion is significant."""
        return self.squared > QUANTILE


def pair_changes(stored: Stored, views: Views) -> list[PairChange]:
    """Motion of all pairs with enough common shots, in which at least one sensor detects corners."""
    shots = views.shots
    observers = {view.sensor for view in views.corners}
    present = [name for name in stored.sensors if name in shots]
    pairs = [(a, b) for a, b in combinations(present, 2) if {a, b} & observers]
    common = {pair: shots[pair[0]] & shots[pair[1]] for pair in pairs}
    return [_change(stored, views.of(pair, both), pair) for pair, both in common.items() if len(both) >= MIN_SHOTS]


def contradicting(changes: Sequence[PairChange]) -> list[Contradiction]:
    """Contradicting shots of all pairs, each once, by number."""
    found = {one.shot: one for change in changes for one in change.contradicting}
    return [found[shot] for shot in sorted(found)]


def _change(stored: Stored, views: Views, pair: tuple[str, str]) -> PairChange:
    second = pair[1]
    solution, contradicting = _consistent(stored, views, pair)
    views = views.of(pair, {*solution.task.shots})
    adjusted = solution.adjustment
    before, after = stored.sensors[second].camera, adjusted.state.sensors[second].camera
    turn = rotations.logarithm((after.T_rs[:3, :3] @ before.T_rs[:3, :3].T)[None])[0]
    move = after.T_rs[:3, 3] - before.T_rs[:3, 3]
    columns = adjusted.layout.columns(second, POSE)
    covariance = adjusted.covariance[np.ix_(columns, columns)] + _stored_covariance(stored, views, pair, adjusted)
    change = np.concatenate([turn, move])
    points = _points(adjusted.state.boards, before, views, second)
    spread = [_shift(before, points, column) for column in np.linalg.cholesky(covariance).T]
    return PairChange(
        *pair,
        len(solution.task.shots),
        turn,
        move,
        _shift(before, points, change),
        float(np.sqrt(np.sum(np.square(spread)))),
        float(change @ np.linalg.solve(covariance, change)),
        tuple(contradicting),
        tuple(changes_of_place(free_shape(solution), NEEDED_PX)),
    )


def _consistent(stored: Stored, views: Views, pair: tuple[str, str]) -> tuple[Solution, list[Contradiction]]:
    """Solution of the shots that agree with each other, and the others; these may be what keeps all from a minimum."""
    try:
        solution = solve(stored, views, pair[1:])
    except NotSolvedError as error:
        for doubtful in _without_minimum(stored, views, pair, error):
            if found := _of_the_rest(stored, views, pair, contradictions(doubtful)):
                return found
        raise
    contradicting = contradictions(solution)
    return _of_the_rest(stored, views, pair, contradicting) or (solution, contradicting)


def _of_the_rest(
    stored: Stored, views: Views, pair: tuple[str, str], suspected: list[Contradiction]
) -> tuple[Solution, list[Contradiction]] | None:
    """Solution of the shots that agree with each other, and the others; None without any or if too few agree.

    What contradicts distorts the solution of all shots, so that others seem to. Each that is suspected is tried with
    those that are not, the least suspected first.
    """
    shots = views.shots
    rest = (shots[pair[0]] & shots[pair[1]]) - {one.shot for one in suspected}
    if not suspected or len(rest) < MIN_SHOTS:
        return None
    found = []
    for one in reversed(suspected):
        if (worse := _contradiction(stored, views, pair, rest, one)) is None:
            rest.add(one.shot)
        else:
            found.append(worse)
    with suppress(NotSolvedError):  # if others contradict as well
        return solve(stored, views.of(pair, rest), pair[1:]), found[::-1]
    return None


def _contradiction(
    stored: Stored, views: Views, pair: tuple[str, str], rest: set[int], suspected: Contradiction
) -> Contradiction | None:
    """The contradiction of a suspected shot with the others; None if it agrees with them."""
    try:
        together = solve(stored, views.of(pair, {*rest, suspected.shot}), pair[1:])
    except NotSolvedError:
        return suspected
    found = [one for one in contradictions(together) if one.shot == suspected.shot]
    return replace(found[0], exchanged_with=suspected.exchanged_with) if found else None


def _without_minimum(stored: Stored, views: Views, pair: tuple[str, str], error: NotSolvedError) -> Iterator[Solution]:
    """Solutions that tell contradicting shots where all together have no minimum: unfinished, then of fixed sensors."""
    if error.unfinished is not None:
        yield Solution(formulation(stored, views, pair[1:]).task, error.unfinished)
    with suppress(NotSolvedError):
        yield solve(stored, views, ())


def _stored_covariance(stored: Stored, views: Views, pair: tuple[str, str], found: Adjustment) -> NDArray[np.float64]:
    """Covariance (6, 6) of the change that errors of the stored calibration make; zero if they are unknown.

    A stored pose that is wrong is a change. Stored intrinsics and depth terms that are wrong turn and move the sensor
    in both solves, which cancels where the boards are as at calibration; the rest is what these views make of it.
    """
    if stored.covariance is None:
        return np.zeros((6, 6))
    names, by_kept = _by_kept(stored, views, pair, found)
    rows, blocks = [stored.names.index(name) for name in names], [by_kept]
    # A rotation of the first sensor translates the second relative to it.
    lever = stored.sensors[pair[1]].camera.center - stored.sensors[pair[0]].camera.center
    carried = np.eye(6)
    carried[3:, :3] = -rotations.cross(lever[None])[0]
    for sensor, block in ((pair[0], -carried), (pair[1], np.eye(6))):
        own = stored.of_pose(sensor)
        rows += own
        blocks += [-block] if own else []
    change = np.concatenate(blocks, axis=1)
    return change @ stored.covariance[np.ix_(rows, rows)] @ change.T


def _by_kept(
    stored: Stored, views: Views, pair: tuple[str, str], found: Adjustment
) -> tuple[list[str], NDArray[np.float64]]:
    """Names of the kept parameters of two sensors with stored deviations (k,), and the pose found by them (6, k)."""
    depth = {view.sensor for view in views.planes}
    equations = formulation(stored, views, pair[1:], depth, uncertain=True)(found.state, found.factors)
    layout = equations.layout
    poses = layout.columns(pair[1], POSE)
    free = np.concatenate([poses, np.arange(layout.board_start, layout.size)])
    columns = {name: column for column, name in enumerate(layout.names[: layout.board_start])}
    kept = np.array([each for name, each in columns.items() if name in stored.names and each not in poses], np.intp)
    jacobian = equations.jacobian(np.zeros(layout.size))
    curvature = (jacobian.T @ jacobian).toarray()
    found_by = -linalg.solve(curvature[np.ix_(free, free)], curvature[np.ix_(free, kept)], assume_a="pos")
    return [layout.names[column] for column in kept], found_by[: len(poses)]


def _points(boards: Mapping[int, Pose], camera: Camera, views: Views, sensor: str) -> NDArray[np.float64]:
    """Points (n, 3) that a sensor saw, in the rig."""
    found = [pose.transform(boards[view.shot], view.points_b) for view in views.corners if view.sensor == sensor]
    for view in views.planes:
        if view.sensor == sensor:
            found.append(pose.transform(camera.T_rs, camera.directions(view.pixels) * view.distances[:, None]))
    return np.concatenate(found)


def _shift(camera: Camera, points_r: NDArray[np.float64], change: NDArray[np.float64]) -> float:
    """Root mean square shift [px] of points by a small rotation and translation (6,) of a camera."""
    T_rs = camera.T_rs.copy()
    T_rs[:3, :3] = rotations.exponential(change[None, :3])[0] @ T_rs[:3, :3]
    T_rs[:3, 3] += change[3:]
    shifts = replace(camera, T_rs=T_rs).project(points_r) - camera.project(points_r)
    return float(np.sqrt(np.nanmean(np.sum(shifts**2, axis=1))))
