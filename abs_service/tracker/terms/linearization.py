"""Linearised residuals: each depends on one point of the surface, each point on a few parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.terms.chain_rule import apply_chain_rule, count_points, sum_at_points, transpose_times
from abs_service.tracker.terms.grouped import GroupedLinearization, add_scores

#: Residuals, rows and points of no measurement.
NO_ROWS = np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Linearization:
    """Normalised residuals and their Jacobian with respect to theta: cost ≈ ½‖residual + jacobian δΘ‖².

    Attributes:
        residual: (m,).
        jacobian: (m, dim).
        positions: of the points that they belong to (m, 3) [m]; empty (0, 3) if they belong to none.
        shared: sum of the derivatives (s, dim) of the residuals that share an error, times that error's deviation.
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    positions: NDArray[np.floating] = field(default_factory=lambda: np.zeros((0, 3)))
    shared: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def parts(self) -> list["Part"]:
        """A list of this linearisation alone."""
        return [self]

    def sources(self) -> list["Linear"]:
        """A list of this linearisation alone."""
        return [self]

    def moved(self, by: NDArray[np.float64]) -> "Linearization":
        """Linearisation with its residuals extrapolated to first order by a step (dim,) of theta."""
        return replace(self, residual=self.residual + self.jacobian @ by)

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k)."""
        return self.jacobian.T @ values if len(values) else np.zeros((dimension, values.shape[1]))

    def add_gradient(self, total: NDArray[np.float64]) -> None:
        """Adds Jᵀr to a gradient (dim,)."""
        total += self.jacobian.T @ self.residual

    def add_curvature(self, total: NDArray[np.float64]) -> None:
        """Adds JᵀJ to a matrix (dim, dim)."""
        total += self.jacobian.T @ self.jacobian  # of one matrix: half the products

    def add_square(self, weights: NDArray[np.float64], total: NDArray[np.float64]) -> None:
        """Adds Jᵀ diag(weights) J, of weights (m,), not negative, to a matrix (dim, dim)."""
        weighted = self.jacobian * np.sqrt(weights)[:, None]
        total += weighted.T @ weighted

    def leverage(self, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """diag(J Σ Jᵀ) (m,) of a covariance Σ (dim, dim)."""
        return np.vecdot(self.jacobian @ covariance, self.jacobian)

    def add_scores(self, clusters: NDArray[np.int64], scores: NDArray[np.float64]) -> None:
        """Adds the score Jᵀr of every residual to that of its cluster (m,), one of the rows of `scores` (…, dim)."""
        every = np.arange(scores.shape[1])[None]
        add_scores(clusters, self.residual, self.jacobian, every, np.array([0, len(clusters)]), scores)


@dataclass(frozen=True, slots=True, eq=False)
class PointLinearization:
    """Normalised residuals and their derivatives with respect to positions; each residual depends on one point.

    Attributes:
        residual: (m,).
        rows: derivatives (m, 3) with respect to the position of the point [1/m].
        points: index (m,) of the point.
        sparse_jacobian: derivative of the points with respect to theta.
        positions: of all points (n, 3) [m].
        shared: derivatives (m, s) with respect to errors that the residuals share, times those errors' deviations.
    """

    residual: NDArray[np.float64]
    rows: NDArray[np.float64]
    points: NDArray[np.int64]
    sparse_jacobian: SparseJacobian
    positions: NDArray[np.floating]
    shared: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Dense Jacobian (m, dim) with respect to theta, in the order of the residuals."""
        order = np.argsort(self.sparse_jacobian.group[self.points], kind="stable")
        result = np.empty((len(order), self.sparse_jacobian.dimension))
        result[order] = stack(self.parts(), self.sparse_jacobian.dimension).jacobian
        return result

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k), matrix-free."""
        sparse_jacobian = self.sparse_jacobian
        at_points, result = (
            np.zeros((len(sparse_jacobian.local), 3, values.shape[1])),
            np.zeros((dimension, values.shape[1])),
        )
        sum_at_points(self.rows, self.points, values, at_points)
        transpose_times(at_points, sparse_jacobian.group, sparse_jacobian.parameters, sparse_jacobian.local, result)
        return result

    def sources(self) -> list["Linear"]:
        """A list of this linearisation alone."""
        return [self]

    def parts(self) -> list["Part"]:
        """A linearisation with respect to theta by the chain rule, sorted by the group of the points."""
        sparse_jacobian = self.sparse_jacobian
        start = np.zeros(len(sparse_jacobian.parameters) + 1, np.int64)
        count_points(self.points, sparse_jacobian.group, start)
        m = len(self.residual)
        residual, jacobian, points = (
            np.empty(m),
            np.empty((m, sparse_jacobian.local.shape[2])),
            np.empty(m, self.points.dtype),
        )
        of_points = sparse_jacobian.group, sparse_jacobian.local
        apply_chain_rule(
            self.residual, self.rows, self.points, *of_points, start[:-1].copy(), residual, jacobian, points
        )
        shared = (
            self.transposed_times(self.shared, sparse_jacobian.dimension).T if self.shared.shape[1] else self.shared
        )
        positions = self.positions[points]
        return [GroupedLinearization(residual, jacobian, sparse_jacobian.parameters, start, positions, shared)]


@dataclass(frozen=True, slots=True, eq=False)
class Together:
    """Concatenation of several linearisations.

    Attributes:
        all: the linearisations.
        dimension: number of parameters.
    """

    all: tuple[Linearization | PointLinearization, ...]
    dimension: int

    @property
    def residual(self) -> NDArray[np.float64]:
        """Concatenated residuals (m,)."""
        return np.concatenate([part.residual for part in self.all])

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Dense Jacobian (m, dim) with respect to theta, in the order of the residuals."""
        return stack(self.all, self.dimension).jacobian

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals, in their order (dimension, k)."""
        ends = np.cumsum([len(part.residual) for part in self.all])[:-1]
        split_values = zip(self.all, np.split(values, ends))
        return np.sum([part.transposed_times(own, dimension) for part, own in split_values], axis=0)

    def parts(self) -> list["Part"]:
        """Parts of all linearisations."""
        return [part for linear in self.all for part in linear.parts()]

    def sources(self) -> list["Linear"]:
        """The linearisations, whose residuals have errors of different origin."""
        return list(self.all)


class Linear(Protocol):
    """Interface of a linearisation, independent of its storage."""

    @property
    def residual(self) -> NDArray[np.float64]:
        """Normalised residuals (m,)."""
        ...

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Jacobian (m, dim or k) with respect to the parameters that the residuals depend on."""
        ...

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals, in their order (dimension, k).

        Args:
            values: one row per residual (m, k).
            dimension: number of parameters of the model.
        """
        ...

    def parts(self) -> list["Part"]:
        """The same residuals in any order, grouped by the parameters that they depend on."""
        ...

    def sources(self) -> list["Linear"]:
        """The linearisations that this one consists of, by the origin of their errors; always as many."""
        ...


#: What linearisations consist of.
Part = Linearization | GroupedLinearization


def stack(parts: Sequence[Linear | Part], dimension: int) -> Linearization:
    """Vertically stacked residuals and Jacobians with respect to all parameters."""
    rows = (part.dense(dimension) if isinstance(part, GroupedLinearization) else part.jacobian for part in parts)
    return Linearization(
        np.concatenate([np.zeros(0), *(part.residual for part in parts)]),
        np.concatenate([np.zeros((0, dimension)), *rows]),
    )
