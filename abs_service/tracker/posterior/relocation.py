"""Lays a mesh that was lost over what was found, roughly: near enough for a search to begin."""

from itertools import product

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel, SparseJacobian
from abs_service.tracker.posterior.curvature import gauss_newton
from abs_service.tracker.posterior.priors import ShapePrior
from abs_service.tracker.posterior.stretch_prior import StretchPrior
from abs_service.tracker.terms.linearization import Linearization

#: Steps of the rough fit, how far vertices and found points may be apart after it [m], and how much edges may stretch.
_STEPS, _APART_M, _STRETCH = 15, 0.01, 0.02

#: Found points that take part in it, at most.
_POINTS = 500


def laid_over(model: DeformationModel, last: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Parameters (dim,) with which the mesh lies on points (k, 3) [m] of a surface that are in sight.

    The undeformed mesh is moved there by the principal axes of both, turned as little as possible against `last`
    (dim,), the last parameters that were trusted: of what looks the same turned upside down, nothing else is known.
    Then it bends: every vertex towards the nearest point and every point towards the nearest vertex, while edges keep
    their lengths.
    """
    thinned = points[:: max(1, len(points) // _POINTS)]
    rest = model.mesh.vertices
    before = model.deform(last[None]).vertices[0].T.astype(np.float64)
    theta = _reached(model, last, _moved(rest, before, thinned))
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


def _moved(rest: NDArray[np.float64], before: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices at rest (n, 3), moved rigidly onto points (k, 3), turned as little as possible against `before`."""
    center, own = _axes(rest)
    place, seen = _axes(points)
    left, _, right = np.linalg.svd((before - before.mean(axis=0)).T @ (rest - center))
    turned = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    turns = [seen @ np.diag([a, b, a * b]) @ own.T for a, b in product((1, -1), repeat=2)]
    turn = max(turns, key=lambda turn: float(np.trace(turn.T @ turned)))
    return (rest - center) @ turn.T + place


def _axes(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre (3,) and right-handed principal axes (3, 3), the longest first, as columns."""
    center = points.mean(axis=0)
    axes = np.linalg.eigh(np.cov((points - center).T))[1][:, ::-1].copy()
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return center, axes


def _reached(model: DeformationModel, theta: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Parameters (dim,) whose vertices come nearest to a target (n, 3) [m]."""
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
    """Rows that pull some vertices, each possibly often, to targets (m, 3)."""
    residual = (vertices[which] - targets) / _APART_M
    jacobian = sparse_jacobian.dense[which] / _APART_M
    return Linearization(residual.reshape(-1), jacobian.reshape(-1, sparse_jacobian.dimension))


def _stepped(theta: NDArray[np.float64], rows: list[Linearization]) -> NDArray[np.float64]:
    """After a Gauss–Newton step, slightly damped: some parameters may move nothing."""
    quadratic = gauss_newton(rows, len(theta))
    damping = 1e-3 * np.trace(quadratic.curvature) / len(theta)
    return theta - np.linalg.solve(quadratic.curvature + damping * np.eye(len(theta)), quadratic.gradient)
