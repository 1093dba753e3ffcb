"""Linearised equations of single shots for changes of the sensors, with the board's pose eliminated.

The residuals of a shot are r + J x + E e: changes x of the sensors since the calibration, and e ~ N(0, 1), by which
each view sees the board elsewhere than it is (exposures at different moments, errors that the distances of a view
share). Among the changes are those of intrinsics with stored deviations: they do not happen, but the stored values are
wrong by so much. The pose of the board is eliminated by an orthogonal transformation, which leaves a few rows of every
shot.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from calib.calibration_check.board_poses import formulation, solve
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle import robust, rotations
from calib.solve.bundle.blocks import Corners
from calib.solve.bundle.equations import Equations
from calib.solve.bundle.parameters.layout import POSE
from calib.solve.bundle.parameters.state import State

#: Directions of a board's pose that change a view by less than this part of the others are not seen in it.
RANK = 1e-6

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WhiteShot:
    """Equations of one shot with unit deviations.

    Attributes:
        residuals: without changes (m,).
        jacobian: with respect to the changes (m, n).
        log_volume: logarithm of the determinant that they were divided by.
    """

    residuals: Array
    jacobian: Array
    log_volume: float


@dataclass(frozen=True)
class ShotEquations:
    """Equations of one shot, normalised by the noise of corners and distances.

    Attributes:
        residuals, jacobian: as of `WhiteShot`.
        by_corners, by_distances: with respect to e of views of corners and of distances, for a scatter of 1 m (m, …).
    """

    residuals: Array
    jacobian: Array
    by_corners: Array
    by_distances: Array

    def whitened(self, corners_m: float, distances_m: float) -> WhiteShot:
        """Equations in which scatter of the board's place from view to view counts as noise."""
        spread = np.hstack([corners_m * self.by_corners, distances_m * self.by_distances])
        factor = linalg.cholesky(np.eye(len(self.residuals)) + spread @ spread.T, lower=True)
        white = linalg.solve_triangular(factor, np.column_stack([self.residuals, self.jacobian]), lower=True)
        return WhiteShot(white[:, 0], white[:, 1:], float(np.sum(np.log(np.diag(factor)))))


@dataclass(frozen=True)
class Linearised:
    """Equations of all shots.

    Attributes:
        names: of the changes (n,): `tof.rotation_x`, `tof.depth_scale`, also `tof.cx` if its deviation is stored.
        shots: equations of each.
        distance_m: median distance of the boards from the sensors [m].
    """

    names: tuple[str, ...]
    shots: Sequence[ShotEquations]
    distance_m: float


@dataclass(frozen=True)
class _View:
    """Rows of one view: residuals (n,), and with respect to the changes (n, …) and to the board's pose (n, 6)."""

    sees_corners: bool
    residuals: Array
    jacobian: Array
    board: Array


def linearise(stored: Stored, views: Views) -> Linearised:
    """Equations of all shots, about the sensor poses that fit them best.

    Raises:
        UndeterminedError, NotSolvedError: the views do not determine the poses of sensors or boards.
    """
    sensors = list(views.shots)
    found = solve(stored, views, sensors[1:]).state
    formulated = formulation(stored, views, sensors, {view.sensor for view in views.planes}, uncertain=True)
    equations = formulated.as_measured(found)
    offset, radius = _middle(views)
    by_shot: dict[int, list[_View]] = {}
    for views_of_group in _views(equations, _changes(stored, found, equations)):
        for number, view in _of_typical_noise(views_of_group).items():
            by_shot.setdefault(number, []).append(view)
    shots = []
    for number, parts in sorted(by_shot.items()):
        lever = found.boards[equations.layout.shots[number]][:3, :3] @ offset
        shots.append(_eliminated(parts, lever, radius))
    return Linearised(equations.layout.names[: equations.layout.board_start], shots, _distance(found))


def _distance(found: State) -> float:
    centers = [sensor.camera.center for sensor in found.sensors.values()]
    return float(
        np.median([np.linalg.norm(T_rb[:3, 3] - center) for T_rb in found.boards.values() for center in centers])
    )


def _changes(stored: Stored, found: State, equations: Equations) -> Array:
    """Increments from the stored sensors to the found ones (n,)."""
    layout = equations.layout
    changes = np.zeros(layout.board_start)
    for name in layout.free_parameters:
        before, after = stored.sensors[name].camera.T_rs, found.sensors[name].camera.T_rs
        turn = rotations.logarithm((after[:3, :3] @ before[:3, :3].T)[None])[0]
        changes[layout.columns(name, POSE)] = np.concatenate([turn, after[:3, 3] - before[:3, 3]])
    return changes


def _middle(views: Views) -> tuple[Array, float]:
    """Middle of the boards' points in their frame (3,) and their root mean square distance from it [m]."""
    points = np.concatenate([view.points_b for view in views.corners])
    middle = points.mean(axis=0)
    return middle, float(np.sqrt(np.mean(np.sum((points - middle) ** 2, axis=1))))


def _views(equations: Equations, changes: Array) -> list[dict[int, _View]]:
    """Views of every group by the row of their shot; residuals are those of the stored sensors."""
    size = len(changes)
    zero = np.zeros(equations.layout.size)
    jacobian = equations.jacobian(zero)
    residuals = equations.residuals(zero) - jacobian[:, :size] @ changes
    found = []
    for group, part in zip(equations.groups, equations.slices(), strict=True):
        dense, shots = jacobian[part].toarray(), group.shots[group.views_of_rows]
        views = {}
        for shot in np.unique(shots):
            mine, start = shots == shot, size + 6 * int(shot)
            board = dense[mine, start : start + 6]
            is_corners = isinstance(group.measured, Corners)
            views[int(shot)] = _View(is_corners, residuals[part][mine], dense[mine, :size], board)
        found.append(views)
    return found


def _of_typical_noise(views: dict[int, _View]) -> dict[int, _View]:
    """Views of one group, normalised by what a board pose of their own leaves, outliers left out."""
    left = {shot: view.residuals - view.board @ _fit(view) for shot, view in views.items()}
    sigma = max(robust.scale(np.concatenate([*left.values()]), sum(len(each) for each in left.values())), 1e-12)
    kept = {}
    for shot, view in views.items():
        near = np.abs(left[shot]) <= robust.OUTLIER * sigma
        parts = (part[near] / sigma for part in (view.residuals, view.jacobian, view.board))
        kept[shot] = _summary(_View(view.sees_corners, *parts))
    return kept


def _fit(view: _View) -> Array:
    return np.linalg.pinv(view.board, rcond=RANK) @ view.residuals


def _summary(view: _View) -> _View:
    """Rows of a view that determine the board's pose: six for corners, three for distances, which only show its plane.

    The rest is shared by neighbouring pixels (bent distances, a lens that does not quite fit), and thousands of them
    would outweigh everything else.
    """
    directions, sizes, _ = np.linalg.svd(view.board / np.linalg.norm(view.board, axis=0).max(), full_matrices=False)
    basis = directions[:, sizes > RANK * sizes[0]].T
    return _View(view.sees_corners, basis @ view.residuals, basis @ view.jacobian, basis @ view.board)


def _eliminated(views: Sequence[_View], lever: Array, radius: float) -> ShotEquations:
    """Equations without the board's pose.

    Args:
        views: of the shot.
        lever: from the origin of the board to its middle, in the rig (3,) [m].
        radius: of the board [m]; scatter turns it by as much as moves a point there as far as the middle.
    """
    # A rotation about the middle is one about the origin with a translation.
    moved = np.block([[np.eye(3) / radius, np.zeros((3, 3))], [rotations.cross(lever[None])[0] / radius, np.eye(3)]])
    board = np.concatenate([view.board for view in views])
    places = np.asarray(linalg.block_diag(*(view.board @ moved for view in views)), np.float64)
    of_corners = np.repeat([view.sees_corners for view in views], 6)
    residuals = np.concatenate([view.residuals for view in views])[:, None]
    jacobian = np.concatenate([view.jacobian for view in views])
    _, triangle = np.linalg.qr(np.concatenate([board, residuals, jacobian, places], axis=1))
    kept = triangle[6:, 6:]
    by_place = kept[:, -len(of_corners) :]
    return ShotEquations(kept[:, 0], kept[:, 1 : -len(of_corners)], by_place[:, of_corners], by_place[:, ~of_corners])
