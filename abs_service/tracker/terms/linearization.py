"""Linearised residuals: each depends on one point of the surface, each point on a few parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian
from calib.jit import kernel

#: All parameters.
EVERY = slice(None)


@dataclass(frozen=True, slots=True, eq=False)
class Linearization:
    """Normalised residuals and their Jacobian with respect to theta: cost ≈ ½‖residual + jacobian δΘ‖².

    Attributes:
        residual: (m,).
        jacobian: (m, k).
        parameters: indices of the k parameters that the residuals depend on.
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    parameters: NDArray[np.int64] | slice = field(default_factory=lambda: EVERY)

    def parts(self) -> list["Linearization"]:
        """A list of this linearisation alone."""
        return [self]

    def moved(self, by: NDArray[np.float64]) -> "Linearization":
        """Linearisation with its residuals extrapolated to first order by a step (dim,) of theta."""
        return Linearization(self.residual + self.jacobian @ by[self.parameters], self.jacobian, self.parameters)

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k)."""
        result = np.zeros((dimension, values.shape[1]))
        result[self.parameters] = self.jacobian.T @ values
        return result


@dataclass(frozen=True, slots=True, eq=False)
class PointLinearization:
    """Normalised residuals and their derivatives with respect to positions; each residual depends on one point.

    Attributes:
        residual: (m,).
        rows: derivatives (m, 3) with respect to the position of the point [1/m].
        points: index (m,) of the point.
        sparse_jacobian: derivative of the points with respect to theta.
    """

    residual: NDArray[np.float64]
    rows: NDArray[np.float64]
    points: NDArray[np.int64]
    sparse_jacobian: SparseJacobian

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
        _gather(self.rows, self.points, values, at_points)
        _transpose(at_points, sparse_jacobian.group, sparse_jacobian.parameters, sparse_jacobian.local, result)
        return result

    def parts(self) -> list[Linearization]:
        """Linearisations with respect to theta by the chain rule, one per group of points."""
        sparse_jacobian = self.sparse_jacobian
        end = np.zeros(len(sparse_jacobian.parameters) + 1, np.int64)
        _count(self.points, sparse_jacobian.group, end)
        residual, jacobian = (
            np.empty(len(self.residual)),
            np.empty((len(self.residual), sparse_jacobian.local.shape[2])),
        )
        _chain(
            self.residual,
            self.rows,
            self.points,
            sparse_jacobian.group,
            sparse_jacobian.local,
            end[:-1].copy(),
            residual,
            jacobian,
        )
        return split(residual, jacobian, end, sparse_jacobian.parameters)


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

    def parts(self) -> list[Linearization]:
        """Parts of all linearisations."""
        return [part for linear in self.all for part in linear.parts()]


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

    def parts(self) -> list[Linearization]:
        """The same residuals in any order, grouped by the parameters that they depend on."""
        ...


def split(
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    start: NDArray[np.int64],
    parameters: NDArray[np.int64],
) -> list[Linearization]:
    """One linearisation per non-empty group of residuals (m,), sorted by group with first indices `start`."""
    return [
        Linearization(residual[first:last], jacobian[first:last], own)
        for first, last, own in zip(start[:-1], start[1:], parameters)
        if last > first
    ]


def stack(parts: Sequence[Linear], dimension: int) -> Linearization:
    """Vertically stacked residuals and Jacobians with respect to all parameters."""
    rows = [np.zeros((0, dimension))]
    for part in parts:
        rows.append(np.zeros((len(part.residual), dimension)))
        rows[-1][:, part.parameters if isinstance(part, Linearization) else EVERY] = part.jacobian
    return Linearization(
        np.concatenate([np.zeros(0), *(part.residual for part in parts)]),
        np.concatenate(rows),
    )


@kernel
def _count(points: NDArray[np.int64], group: NDArray[np.int32], start: NDArray[np.int64]) -> None:
    """First index of each group's residuals in sorted order, and their total, into zeros (groups + 1,)."""
    for m in range(points.size):
        start[group[points[m]] + 1] += 1
    for g in range(1, start.size):
        start[g] += start[g - 1]


@kernel
def _chain(
    residual: NDArray[np.float64],
    rows: NDArray[np.float64],
    points: NDArray[np.int64],
    group: NDArray[np.int32],
    local: NDArray[np.float64],
    place: NDArray[np.int64],
    sorted_residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Rows times the Jacobians of their points, sorted by group; `place` is the first index of each group.

    A library needs ten times as long for thousands of products of 1 × 3 by 3 × k matrices.
    """
    for m in range(points.size):
        v = points[m]
        to = place[group[v]]
        place[group[v]] += 1
        sorted_residual[to] = residual[m]
        x, y, z = rows[m, 0], rows[m, 1], rows[m, 2]
        for d in range(local.shape[2]):
            jacobian[to, d] = x * local[v, 0, d] + y * local[v, 1, d] + z * local[v, 2, d]


@kernel
def _gather(
    rows: NDArray[np.float64], points: NDArray[np.int64], values: NDArray[np.float64], at_points: NDArray[np.float64]
) -> None:
    """Sum of rowᵀ times value (3, k) over the residuals of each point, into zeros (n, 3, k)."""
    for m in range(points.size):
        for i in range(3):
            total = at_points[points[m], i]
            for k in range(values.shape[1]):
                total[k] += rows[m, i] * values[m, k]


@kernel
def _transpose(
    at_points: NDArray[np.float64],
    group: NDArray[np.int32],
    parameters: NDArray[np.int64],
    local: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Transposed Jacobian of the points times values at the points (n, 3, k), into zeros (dim, k)."""
    for v in range(group.size):
        own = parameters[group[v]]
        for d in range(own.size):
            total = result[own[d]]
            for i in range(3):
                for k in range(total.size):
                    total[k] += local[v, i, d] * at_points[v, i, k]
