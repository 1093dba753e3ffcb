"""Relocation: coarse fit of the mesh to points of a lost object, as the start of a search."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel, SparseJacobian
from abs_service.tracker.posterior.curvature import gauss_newton
from abs_service.tracker.posterior.priors.shape_prior import ShapePrior
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.grouped import GroupedLinearization
from abs_service.tracker.terms.linearization import Linearization
from calib.pose import nearest_rotation

#: Steps of the coarse fit, σ of the distances between vertices and points [m], and σ of the relative edge stretch.
_STEPS, _APART_M, _STRETCH = 15, 0.01, 0.02

#: Maximum number of points in the fit.
_POINTS = 500


def fit_to_points(
    model: DeformationModel, last: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Parameters (dim,) that fit the mesh to points (k, 3) [m] of the visible surface.

    The undeformed mesh is aligned by the principal axes of both. Of the four alignments, the one with the smallest
    rotation from `last` (dim,), the last trusted parameters, is taken, because a symmetric object does not define it.
    Then theta is fitted as in non-rigid ICP: every vertex to the nearest point and every point to the nearest vertex,
    under the stretch prior.
    """
    thinned = points[:: max(1, len(points) // _POINTS)]
    rest = model.mesh.vertices
    before = model.deform(last[None]).vertices[0].T.astype(np.float64)
    theta = fit_to_vertices(model, last, _aligned(rest, before, thinned))
    stretch, shape = StretchPrior(model.mesh, _STRETCH), ShapePrior(model.rest, model.prior)
    tree = scipy.spatial.KDTree(thinned)
    for _ in range(_STEPS):
        surface, sparse_jacobian = model.deform(theta[None]), model.sparse_jacobian(theta)
        vertices = surface.vertices[0].T.astype(np.float64)
        nearest = scipy.spatial.KDTree(vertices).query(thinned)[1]
        attracted = np.concatenate([np.arange(len(vertices)), nearest])
        targets = np.concatenate([thinned[tree.query(vertices)[1]], thinned])
        rows = [_towards(vertices, sparse_jacobian, attracted, targets), *stretch.linearize(surface, sparse_jacobian)]
        theta = _stepped(theta, [*rows, shape.linearize(theta)])
    return theta


def _aligned(
    rest: NDArray[np.float64], before: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Rest vertices (n, 3) rigidly aligned with points (k, 3), with the smallest rotation from `before`."""
    center, own = _axes(rest)
    place, seen = _axes(points)
    turned = nearest_rotation((before - before.mean(axis=0)).T @ (rest - center))
    turns = [seen @ np.diag([a, b, a * b]) @ own.T for a, b in product((1, -1), repeat=2)]
    turn = max(turns, key=lambda turn: float(np.trace(turn.T @ turned)))
    return (rest - center) @ turn.T + place


def _axes(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre (3,) and right-handed principal axes (3, 3), the longest first, as columns."""
    center = points.mean(axis=0)
    axes = np.linalg.eigh(np.cov((points - center).T))[1][:, ::-1].copy()
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return center, axes


def fit_to_vertices(
    model: DeformationModel, theta: NDArray[np.float64], target: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Least-squares parameters (dim,) for target vertices (n, 3) [m], from theta (dim,) on."""
    everywhere = np.arange(len(target))
    for _ in range(_STEPS):
        vertices = model.deform(theta[None]).vertices[0].T.astype(np.float64)
        theta = _stepped(theta, [_towards(vertices, model.sparse_jacobian(theta), everywhere, target)])
    return theta


def _towards(
    vertices: NDArray[np.float64],
    sparse_jacobian: SparseJacobian,
    which: NDArray[np.intp],
    targets: NDArray[np.float64],
) -> Linearization:
    """Linearised distances of vertices, possibly repeated, from targets (m, 3)."""
    residual = (vertices[which] - targets) / _APART_M
    jacobian = sparse_jacobian.dense[which] / _APART_M
    return Linearization(residual.reshape(-1), jacobian.reshape(-1, sparse_jacobian.dimension))


def _stepped(theta: NDArray[np.float64], rows: Sequence[Linearization | GroupedLinearization]) -> NDArray[np.float64]:
    """Theta after a damped Gauss–Newton step; damping covers parameters without influence."""
    quadratic = gauss_newton(rows, len(theta))
    damping = 1e-3 * np.trace(quadratic.curvature) / len(theta)
    return theta - np.linalg.solve(quadratic.curvature + damping * np.eye(len(theta)), quadratic.gradient)
