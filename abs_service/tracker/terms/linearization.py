"""Linearised residuals: each depends on the position of one point of the surface, and the point on few parameters."""

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
    """Normalised residuals and their derivatives by the parameters: the cost is about ½‖residual + jacobian δΘ‖².

    Attributes:
        residual: (m,).
        jacobian: (m, k).
        parameters: the k parameters that the residuals depend on.
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    parameters: NDArray[np.int64] | slice = field(default_factory=lambda: EVERY)

    def parts(self) -> list["Linearization"]:
        """Itself."""
        return [self]

    def moved(self, by: NDArray[np.float64]) -> "Linearization":
        """The residuals, to first order, when all parameters have changed by so much (dim,)."""
        return Linearization(self.residual + self.jacobian @ by[self.parameters], self.jacobian, self.parameters)

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k)."""
        result = np.zeros((dimension, values.shape[1]))
        result[self.parameters] = self.jacobian.T @ values
        return result


@dataclass(frozen=True, slots=True, eq=False)
class PointLinearization:
    """Normalised residuals and their derivatives by positions: every residual depends on that of one point.

    Attributes:
        residual: (m,).
        rows: derivatives (m, 3) by the position of the point [1/m].
        points: which point (m,) that is.
        sparse_jacobian: derivative of the points with respect to theta.
    """

    residual: NDArray[np.float64]
    rows: NDArray[np.float64]
    points: NDArray[np.int64]
    sparse_jacobian: SparseJacobian

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Derivatives (m, dim) by all parameters, in the order of the residuals."""
        order = np.argsort(self.sparse_jacobian.group[self.points], kind="stable")
        result = np.empty((len(order), self.sparse_jacobian.dimension))
        result[order] = stack(self.parts(), self.sparse_jacobian.dimension).jacobian
        return result

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals (dimension, k), without making J."""
        sparse_jacobian = self.sparse_jacobian
        at_points, result = (
            np.zeros((len(sparse_jacobian.local), 3, values.shape[1])),
            np.zeros((dimension, values.shape[1])),
        )
        _gather(self.rows, self.points, values, at_points)
        _transpose(at_points, sparse_jacobian.group, sparse_jacobian.parameters, sparse_jacobian.local, result)
        return result

    def parts(self) -> list[Linearization]:
        """The residuals by the parameters, by the chain rule; those of each group of points in one part."""
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
    """Several linearisations as one.

    Attributes:
        all: them.
        dimension: number of parameters.
    """

    all: tuple[Linearization | PointLinearization, ...]
    dimension: int

    @property
    def residual(self) -> NDArray[np.float64]:
        """Their residuals, one after the other."""
        return np.concatenate([part.residual for part in self.all])

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Their derivatives by all parameters, in the order of the residuals."""
        return stack(self.all, self.dimension).jacobian

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals, in their order (dimension, k)."""
        ends = np.cumsum([len(part.residual) for part in self.all])[:-1]
        split_values = zip(self.all, np.split(values, ends))
        return np.sum([part.transposed_times(own, dimension) for part, own in split_values], axis=0)

    def parts(self) -> list[Linearization]:
        """The parts of each."""
        return [part for linear in self.all for part in linear.parts()]


class Linear(Protocol):
    """What a linearisation can be asked, however it is kept."""

    @property
    def residual(self) -> NDArray[np.float64]:
        """Normalised residuals (m,)."""
        ...

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """Their derivatives (m, dim or k) by the parameters that they depend on."""
        ...

    def transposed_times(self, values: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
        """Jᵀ times values (m, k) of the residuals, in their order (dimension, k).

        Args:
            values: of the residuals (m, k).
            dimension: number of all parameters.
        """
        ...

    def parts(self) -> list[Linearization]:
        """The same residuals, in any order, each part by the parameters that it depends on."""
        ...


def split(
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    start: NDArray[np.int64],
    parameters: NDArray[np.int64],
) -> list[Linearization]:
    """Residuals (m,) that are sorted by group, of which each begins at `start`, one part for each that has any."""
    return [
        Linearization(residual[first:last], jacobian[first:last], own)
        for first, last, own in zip(start[:-1], start[1:], parameters)
        if last > first
    ]


def stack(parts: Sequence[Linear], dimension: int) -> Linearization:
    """All residuals of several linearisations below each other, by all parameters."""
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
    """Where the residuals of each group begin when they are sorted, and their number; zeros (groups + 1,) before."""
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
    """Rows times the moves of their points, sorted by group; `place` is where each group's first goes.

    A library multiplies thousands of 3 × 3 by 3 × k matrices ten times as slowly.
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
    """Adds rowᵀ times value (3, k) of every residual to its point's; zeros (n, 3, k) before."""
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
    """Moves transposed times what is at the points (n, 3, k), added up by parameter; zeros (dim, k) before."""
    for v in range(group.size):
        own = parameters[group[v]]
        for d in range(own.size):
            total = result[own[d]]
            for i in range(3):
                for k in range(total.size):
                    total[k] += local[v, i, d] * at_points[v, i, k]
