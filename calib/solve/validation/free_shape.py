"""Information of the poses beside a board and lenses of any smooth shape.

A board that is not flat or not printed evenly, and a lens that fits nearly, displace the corners of all views. That
hides what happened to a sensor in some of them, and looks like it where the boards were elsewhere. So displacements of
the board and of the image that are polynomials are solved along, by one reweighted step; what is left scatters half as
much in real sets.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from calib.solve.bundle import robust
from calib.solve.bundle.bent_boards import shape_columns
from calib.solve.bundle.blocks import Corners
from calib.solve.bundle.equations import DAMPING, Equations
from calib.solve.bundle.uncertainty import PoseInformation, information_of
from calib.solve.solution import Solution

#: Degrees of the polynomials: out of the board, in its plane, and in an image; those that poses and camera matrices do
#: as well are left out.
_OUT, _IN, _IMAGE = 4, 3, 5

#: Deviations of their coefficients, in parts of the board's radius and of half of the image's width.
_OF_BOARD, _OF_IMAGE = 0.03, 0.01

#: With more parameters than this share of the measurements the shapes stay as they are.
_MAX_SHARE = 0.4

_STEPS = 4

Array = NDArray[np.float64]
Members = NDArray[np.bool_]


@dataclass(frozen=True)
class FreeShape:
    """A solution, and what its poses say if the board and the lenses may have any smooth shape.

    Attributes:
        solution: with the shapes that are described.
        poses: information of the poses on the sensors' parameters, followed by the coefficients.
        inflation: variance of an estimate relative to least squares with unit deviations.
        misses: root mean square residual of the corners that is left, by sensor and shot [px].
    """

    solution: Solution
    poses: PoseInformation
    inflation: float
    misses: Mapping[tuple[str, int], float]

    @property
    def size(self) -> int:
        """Number of the sensors' parameters and of coefficients."""
        return len(self.poses.prior)


def free_shape(solution: Solution) -> FreeShape:
    """Solves the shapes of the board and of the lenses along."""
    equations = solution.adjustment.equations
    jacobian = equations.base_jacobian
    residuals, measured, count = solution.adjustment.residuals, int(equations.ends[-1]), equations.layout.board_start
    added = np.hstack([shape_columns(equations, jacobian, _of_board), _of_lenses(equations, residuals)])
    if equations.layout.size + added.shape[1] > _MAX_SHARE * measured:
        added = added[:, :0]
    size = equations.layout.size
    below = np.zeros((len(residuals) - measured, added.shape[1]))
    priors = sparse.csr_array((added.shape[1], size))
    blocks = [
        [jacobian[:, :count], np.vstack([added, below]), jacobian[:, count:]],
        [priors[:, :count], sparse.eye_array(added.shape[1]), priors[:, count:]],
    ]
    whole = sparse.csr_array(sparse.block_array(blocks))
    left = _fitted(whole, np.concatenate([residuals, np.zeros(added.shape[1])]))
    misses, scales = _misses(equations, left), np.ones(len(left))
    redundancy = 1 - min((size + added.shape[1]) / measured, 0.9)
    for part in equations.slices():
        scales[part] = robust.scale(left[part], redundancy * len(left[part])) or 1.0
    left, whole = left / scales, _weighted(whole, 1 / scales)
    poses = information_of(whole, count + added.shape[1], equations, left)
    return FreeShape(solution, poses, robust.covariance_inflation(left[:measured]), misses)


class DistinctPoses(NamedTuple):
    """Information of the poses as if every distinct one had been seen once.

    Attributes:
        information: of poses (poses, k, k).
        scores: of poses (poses, k).
    """

    information: Array
    scores: Array


class AlongDirections(NamedTuple):
    """Information of poses along directions.

    Attributes:
        directions: (k, m).
        lower: root of all information, lower triangle (k, k).
        own: information of each pose along the directions (poses, m, m).
        whole: what all poses know of it already, divided by the root (poses, k, m).
    """

    directions: Array
    lower: Array
    own: Array
    whole: Array


def once(poses: PoseInformation) -> DistinctPoses:
    """Information and scores of poses without their repetitions."""
    repeats = poses.repeats
    return DistinctPoses(poses.information / repeats[:, None, None], poses.scores / repeats[:, None] / poses.efficiency)


def along(directions: Array, information: Array, prior: Array) -> AlongDirections:
    """Information of poses along directions (k, m); a prior (k, k) adds to that of all poses (poses, k, k)."""
    lower = linalg.cholesky(information.sum(axis=0) + prior, lower=True)
    whole = linalg.solve_triangular(lower, np.eye(len(lower)), lower=True) @ information @ directions
    return AlongDirections(directions, lower, directions.T @ information @ directions, whole)


def without(poses: DistinctPoses, known: AlongDirections, members: Members, change: Array) -> Array:
    """Scores (poses, k) that are left if some poses (poses,) have a change (m,) along `known` from the others."""
    moved = known.whole[members].sum(axis=0) @ change
    others = -linalg.solve_triangular(known.lower, moved, lower=True, trans=1)
    changes = others + np.outer(members, known.directions @ change)
    return poses.scores - (poses.information @ changes[:, :, None])[:, :, 0]


def disagreement(information: Array, scores: Array) -> float:
    """Mean squared score of the poses that say anything of the sensors, in deviations that noise alone would have."""
    found = []
    for own, score in zip(information, scores, strict=True):
        sizes, axes = np.linalg.eigh(own)
        known = sizes > 1e-6 * sizes[-1]
        if known.any():  # of those that only a camera with fixed intrinsics saw, none is
            found.append(np.mean((axes.T @ score)[known] ** 2 / sizes[known]))
    return max(float(np.mean(found or 1.0)), 1.0)


def _weighted(jacobian: sparse.csr_array, weights: Array) -> sparse.csr_array:
    return sparse.csr_array(sparse.diags_array(weights) @ jacobian)


def _fitted(jacobian: sparse.csr_array, residuals: Array) -> Array:
    """Residuals (n,) that robust linear least squares leave."""
    left = residuals
    for _ in range(_STEPS):
        weights = robust.influence(left) / np.where(left == 0, 1, left)
        weighted = _weighted(jacobian, weights)
        curvature = (jacobian.T @ weighted).toarray()
        sizes = np.sqrt(np.maximum(curvature.diagonal(), 1e-30))
        curvature = curvature / np.outer(sizes, sizes) + DAMPING * np.eye(len(sizes))
        step = linalg.solve(curvature, weighted.T @ residuals / sizes, assume_a="pos") / sizes
        left = residuals - jacobian @ step
    return left


def _misses(equations: Equations, left: Array) -> dict[tuple[str, int], float]:
    """Root mean square of residuals (n,) of corners by sensor and shot [px]; none of boards between two shots."""
    found = {}
    for group, rows in zip(equations.groups, equations.slices(), strict=True):
        if isinstance(group.measured, Corners) and group.shots.ndim == 1:
            squares = np.sum((left[rows].reshape(-1, 2) * group.measured.sigmas[:, None]) ** 2, axis=1)
            views = group.views_of_rows[::2]
            means = np.bincount(views, squares) / np.bincount(views)
            shots = (equations.layout.shots[index] for index in group.shots)
            found |= {(group.sensor, shot): float(mean) ** 0.5 for shot, mean in zip(shots, means, strict=True)}
    return found


def _of_board(points: Array) -> Array:
    """Displacements of points of the board (n, 3) in its frame (n, m, 3) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = max((high - low).max() / 2, 1e-12)
    places = (points - (low + high) / 2)[:, :2] / radius
    parts = [(2, _powers(places, _OUT)[:, 3:]), *((axis, _powers(places, _IN)) for axis in (0, 1))]
    axes = np.eye(3)
    return _OF_BOARD * radius * np.concatenate([values[:, :, None] * axes[axis] for axis, values in parts], axis=1)


def _of_lenses(equations: Equations, residuals: Array) -> Array:
    """Derivatives of the residuals with respect to displacements in the image of every sensor (n, m)."""
    found = []
    for group, rows in zip(equations.groups, equations.slices(), strict=True):
        if not isinstance(group.measured, Corners):
            continue
        corners, camera = group.measured, equations.base.sensors[group.sensor].camera
        # Of measured places, the residuals themselves would be a polynomial.
        predicted = corners.pixels + residuals[rows].reshape(-1, 2) * corners.sigmas[:, None]
        places = 2 * (predicted - (camera.cx, camera.cy)) / camera.width
        values = _OF_IMAGE * camera.width / 2 * _powers(places, _IMAGE)[:, 3:] / corners.sigmas[:, None]
        own = np.zeros((int(equations.ends[-1]), 2 * values.shape[1]))
        own[rows] = np.kron(values, np.eye(2))
        found.append(own)
    return np.hstack(found) if found else np.zeros((int(equations.ends[-1]), 0))


def _powers(places: Array, degree: int) -> Array:
    """Monomials of places (n, 2) up to a degree (n, m), in its order."""
    x, y = places.T
    return np.stack([x ** (whole - power) * y**power for whole in range(degree + 1) for power in range(whole + 1)], 1)
