"""Linearised residuals: each depends on one point of the surface, each point on a few parameters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.terms import chain_rule
from abs_service.tracker.terms.grouped import GroupedLinearization, add_group_squares

#: Derivatives with respect to errors that residuals share, found when a covariance asks for them.
Shared = Callable[[], NDArray[np.float64]]

#: Derivatives (m, 3) of residuals by what is known of the surface itself, from those by the measurements (m, 3).
OfSurface = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def nothing_shared() -> NDArray[np.float64]:
    """No derivatives (0, 0): the residuals have no error in common."""
    return np.zeros((0, 0))


def as_measured(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The derivatives (m, 3) by the measurements: what these show is the surface's own."""
    return rows


def of_anything(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Zeros (m, 3): the residuals do not depend on which part of the surface is there."""
    return np.zeros_like(rows)


def not_longer(of_surface: Callable[[], NDArray[np.float64]], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (m, 3) by the surface itself, not longer in all than those by the measurements (m, 3).

    In the first image, the noise of the two is the same; it has been taken away from the measurements' only.
    """
    own = of_surface()
    return own * np.sqrt(min(np.vdot(rows, rows) / max(np.vdot(own, own), 1e-300), 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Linearization:
    """Normalised residuals and their Jacobian with respect to theta: cost ≈ ½‖residual + jacobian δΘ‖².

    Attributes:
        residual: (m,).
        jacobian: (m, dim).
        places: of the points that they belong to (m, 3) [m]; empty (0, 3) if they belong to none.
        rows: derivatives (m, 3) with respect to the positions of these [1/m]; likewise.
        shared: tells the sum of the derivatives (s, dim) of the residuals that share an error, times its deviation.
        of_surface: see `PointLinearization`.
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    places: NDArray[np.floating] = field(default_factory=lambda: np.zeros((0, 3)))
    rows: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    shared: Shared = nothing_shared
    of_surface: OfSurface = as_measured

    def moved(self, by: NDArray[np.float64]) -> "Linearization":
        """Linearisation with its residuals extrapolated to first order by a step (dim,) of theta."""
        return replace(self, residual=self.residual + self.jacobian @ by)

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k)."""
        return self.jacobian.T @ values if len(values) else np.zeros((dimension, values.shape[1]))

    def shared_gradients(self) -> NDArray[np.float64]:
        """Sums of derivatives (s, dim), see `shared`."""
        return self.shared()

    def add_gradient(self, total: NDArray[np.float64]) -> None:
        """Adds Jᵀr to a gradient (dim,)."""
        total += self.jacobian.T @ self.residual

    def add_curvature(self, total: NDArray[np.float64]) -> None:
        """Adds JᵀJ to a matrix (dim, dim)."""
        total += self.jacobian.T @ self.jacobian  # of one matrix: half the products

    def leverage(self, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """diag(J Σ Jᵀ) (m,) of a covariance Σ (dim, dim) of theta."""
        return np.vecdot(self.jacobian @ covariance, self.jacobian)

    def add_scores(self, clusters: NDArray[np.int64], scores: NDArray[np.floating]) -> None:
        """Adds the score Jᵀr of every residual to that of its cluster (m,), one of the rows of `scores` (…, dim)."""
        chain_rule.add_dense_scores(clusters, self.residual, self.jacobian, scores)


@dataclass(frozen=True, slots=True, eq=False)
class PointLinearization:
    """Normalised residuals and their derivatives with respect to positions; each residual depends on one point.

    Attributes:
        residual: (m,).
        rows: derivatives (m, 3) with respect to the position of the point [1/m].
        points: index (m,) of the point.
        sparse_jacobian: derivative of the points with respect to theta.
        positions: of all points (n, 3) [m].
        shared: tells the derivatives (m, s) with respect to errors that the residuals share, times their deviations.
        center: of the camera (3,) [m] that tells of motion across its lines of sight only; empty (0,) for distances.
        of_surface: what of the derivatives the surface itself has; only this tells which part of it is where.
    """

    residual: NDArray[np.float64]
    rows: NDArray[np.float64]
    points: NDArray[np.int64]
    sparse_jacobian: SparseJacobian
    positions: NDArray[np.floating]
    shared: Shared = nothing_shared
    center: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    of_surface: OfSurface = as_measured

    @classmethod
    def empty(cls, sparse_jacobian: SparseJacobian) -> "PointLinearization":
        """Linearization without measurements."""
        return cls(np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.int64), sparse_jacobian, np.zeros((0, 3)))

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Dense Jacobian (m, dim) with respect to theta."""
        return np.einsum("mi,mid->md", self.rows, self.sparse_jacobian.dense[self.points])

    @property
    def places(self) -> NDArray[np.floating]:
        """Positions of the points that the residuals belong to (m, 3) [m]."""
        return self.positions[self.points]

    def moved(self, by: NDArray[np.float64]) -> "PointLinearization":
        """Linearisation with its residuals extrapolated to first order by a step (dim,) of theta."""
        if not len(self.residual):
            return self
        residual = np.empty_like(self.residual)
        chain_rule.extrapolate(self.residual, self.rows, self.points, self.sparse_jacobian.blocks, by, residual)
        return replace(self, residual=residual)

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k), matrix-free."""
        result = np.zeros((dimension, values.shape[1]))
        at_points = np.zeros((len(self.sparse_jacobian.local), 3, values.shape[1]))
        chain_rule.sum_at_points(self.rows, self.points, values, at_points)
        chain_rule.transpose_times(at_points, self.sparse_jacobian.blocks, result)
        return result

    def shared_gradients(self) -> NDArray[np.float64]:
        """Sum of the derivatives (s, dim) of the residuals that share an error, times that error's deviation."""
        shared = self.shared()
        return self.transposed_times(shared, self.sparse_jacobian.dimension).T if shared.shape[1] else shared

    def leverage(self, at_points: NDArray[np.float64]) -> NDArray[np.float64]:
        """diag(J Σ Jᵀ) (m,), from the covariances (n, 3, 3) of the points by a covariance Σ of theta."""
        result = np.empty(len(self.residual))
        chain_rule.find_leverages(self.rows, self.points, at_points, result)
        return result

    def add_scores(self, clusters: NDArray[np.int64], scores: NDArray[np.floating]) -> None:
        """Adds the score Jᵀr of every residual to that of its cluster (m,), one of the rows of `scores` (…, dim)."""
        chain_rule.add_scores(clusters, self.residual, self.rows, self.points, self.sparse_jacobian.blocks, scores)


#: Linearised residuals whose errors have one origin; those of a sensor are of one or several.
Part = Linearization | PointLinearization


def propagated(sparse_jacobian: SparseJacobian, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance D Σ Dᵀ (n, 3, 3) of every point, from its Jacobian D and the covariance Σ (dim, dim) of theta."""
    result = np.empty((len(sparse_jacobian.local), 3, 3))
    chain_rule.propagate(sparse_jacobian.blocks, np.ascontiguousarray(covariance), result)
    return result


def add_gradients(parts: Sequence[PointLinearization], total: NDArray[np.float64]) -> None:
    """Adds Jᵀr of every part to a gradient (dim,).

    What different sensors measure of the same points is added up at the points first.
    """
    at_points: dict[SparseJacobian, NDArray[np.float64]] = {}
    for part in parts:
        samples = part.sparse_jacobian
        forces = at_points.setdefault(samples, np.zeros((len(samples.local), 3, 1)))
        chain_rule.sum_at_points(part.rows, part.points, part.residual[:, None], forces)
    for samples, forces in at_points.items():
        chain_rule.transpose_times(forces, samples.blocks, total[:, None])


def add_squares(parts: Sequence[Part], weights: Sequence[NDArray[np.float64]], total: NDArray[np.float64]) -> None:
    """Adds Jᵀ diag(weights) J, of weights (m,) of every part, not negative, to a matrix (dim, dim).

    See `add_gradients`.
    """
    at_points: dict[SparseJacobian, NDArray[np.float64]] = {}
    for part, own in zip(parts, weights, strict=True):
        if not len(own):
            continue
        if isinstance(part, PointLinearization):
            samples = part.sparse_jacobian
            squares = at_points.setdefault(samples, np.zeros((len(samples.local), 3, 3)))
            chain_rule.sum_squares(part.rows, part.points, own, squares)
        else:
            weighted = part.jacobian * np.sqrt(own)[:, None]
            total += weighted.T @ weighted  # of one matrix: half the products
    for samples, squares in at_points.items():
        n, _, k = samples.local.shape
        rows, start, groups = np.empty((3 * n, k)), np.empty(n + 1, np.int64), np.empty(n, np.int64)
        runs = chain_rule.find_roots(squares, samples.blocks, rows, start, groups)
        add_group_squares(rows, samples.parameters[groups[:runs]], start[: runs + 1], total)


def stack(parts: Sequence[Part | GroupedLinearization], dimension: int) -> Linearization:
    """Vertically stacked residuals and Jacobians with respect to all parameters."""
    rows = (part.dense(dimension) if isinstance(part, GroupedLinearization) else part.jacobian for part in parts)
    return Linearization(
        np.concatenate([np.zeros(0), *(part.residual for part in parts)]),
        np.concatenate([np.zeros((0, dimension)), *rows]),
    )
