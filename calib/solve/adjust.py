"""Robust least squares on a calibration's equations, deviations of the groups included.

SciPy's trust region runs in the metric of the curvature where it starts (as the tracker's search does, docs/decisions):
focal lengths in pixels, coefficients of a lens and metres then are all of the same size and nearly independent, and the
inner solver needs a dozen products with the sparse Jacobian instead of thousands.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.optimize import least_squares
from scipy.sparse.linalg import aslinearoperator

from calib.solve import robust
from calib.solve.blocks import Planes
from calib.solve.determined import require_determined
from calib.solve.equations import Equations, Group
from calib.solve.layout import Layout
from calib.solve.state import State

#: Given the equations at a state, with the deviations found so far.
Formulate = Callable[[State, tuple[float, ...]], Equations]

#: Searches with deviations of the groups estimated in between.
ROUNDS = 3

#: A factor of a deviation is not believed to be smaller: no detector is a hundred times better than it says.
LEAST_FACTOR = 0.01


class NotSolvedError(ValueError):
    """The search found no minimum."""


@dataclass(frozen=True)
class Adjustment:
    """The minimum and what is known of it.

    Attributes:
        equations: at the minimum: its `base` is the solution, and the deviations in it are the estimated ones.
        factors: by which the deviations of every group were multiplied.
        covariance: of increments of the parameters (size, size).
        residuals: in estimated deviations (n,).
    """

    equations: Equations
    factors: tuple[float, ...]
    covariance: NDArray[np.float64]
    residuals: NDArray[np.float64]

    @property
    def state(self) -> State:
        """The solution."""
        return self.equations.base

    @property
    def layout(self) -> Layout:
        """Its parameters."""
        return self.equations.layout


def adjust(formulate: Formulate, start: State, groups: int, note: Callable[[str], None]) -> Adjustment:
    """Finds the state that explains the measurements best.

    Args:
        formulate: builds the equations about a state.
        start: state to begin with.
        groups: number of groups of measurements.
        note: told in words how it goes.

    Raises:
        UndeterminedError: if the measurements leave some parameter open.
        NotSolvedError: if the search did not end, or the start explains nothing.
    """
    factors = (1.0,) * groups
    found = _round(formulate, start, factors)
    for number in range(1, ROUNDS):
        note(f"round {number} of {ROUNDS}: {_rms(found.residuals):.2f} deviations rms")
        found = _round(formulate, found.state, _rescaled(found))
    note(f"round {ROUNDS} of {ROUNDS}: {_rms(found.residuals):.2f} deviations rms")
    return found


def _round(formulate: Formulate, start: State, factors: tuple[float, ...]) -> Adjustment:
    equations = formulate(search(formulate(start, factors)), factors)
    return Adjustment(equations, factors, *_covariance(equations))


def search(equations: Equations) -> State:
    """The state that explains the measurements of some equations best.

    Raises:
        UndeterminedError, NotSolvedError: as `adjust`.
    """
    start = np.zeros(equations.layout.size)
    residuals = equations.residuals(start)
    if not np.all(np.isfinite(residuals)):
        raise NotSolvedError("the first guess puts a board behind a camera that saw it; check the given calibration")
    jacobian = equations.jacobian(start)
    # Weighted as the loss weighs the residuals there, so that a few gross errors do not shape the metric.
    weights = sparse.diags_array(np.sqrt(robust.influence(residuals) / np.where(residuals == 0, 1, residuals)))
    curvature = require_determined(_normal(weights @ jacobian), equations.layout.names)
    metric = linalg.cholesky(curvature + 1e-12 * np.diag(np.diag(curvature)), lower=True)
    inverse_metric = linalg.solve_triangular(metric.T, np.eye(len(metric)))

    def unscaled(steps: NDArray[np.float64]) -> NDArray[np.float64]:
        return inverse_metric @ steps

    def derivatives(
        steps: NDArray[np.float64],
    ) -> Any:  # a product of two linear operators, for which SciPy has no public type
        matrix = aslinearoperator(equations.jacobian(unscaled(steps)))
        return matrix @ aslinearoperator(inverse_metric)

    found = least_squares(
        lambda steps: equations.residuals(unscaled(steps)),
        np.zeros(equations.layout.size),
        jac=derivatives,  # pyright: ignore[reportArgumentType]
        method="trf",
        tr_solver="lsmr",
        loss="soft_l1",
        f_scale=robust.SOFT_L1_SCALE,
        ftol=1e-8,  # a cost of n / 2 then ends within a hundredth of a deviation
        xtol=1e-10,
        gtol=1e-3,  # of a deviation, since the metric is that of the curvature
        max_nfev=200,
    )
    if found.status == 0:
        raise NotSolvedError(
            "no minimum after 200 steps: the views contradict each other, or the kind of lens does not fit"
        )
    return equations.layout.move(equations.base, unscaled(found.x))


def _covariance(equations: Equations) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance of the increments and whitened residuals at the equations' base."""
    zero = np.zeros(equations.layout.size)
    residuals = equations.residuals(zero)
    curvature = require_determined(_normal(equations.jacobian(zero)), equations.layout.names)
    size = np.sqrt(np.diag(curvature))
    inverse = linalg.inv(curvature / np.outer(size, size)) / np.outer(size, size)
    return _widening(equations, residuals) * (inverse + inverse.T) / 2, residuals


def _widening(equations: Equations, residuals: NDArray[np.float64]) -> float:
    """By how much the robust loss widens the covariance: the mean over the groups, each with unit deviations."""
    unit = []
    for rows in equations.slices():
        own = residuals[rows]
        unit.append(own / max(robust.scale(own, own.size), 1e-12))
    return robust.widening(np.concatenate(unit))


def _rescaled(solved: Adjustment) -> tuple[float, ...]:
    """Deviations of the groups as their residuals show them (estimation of variance components)."""
    equations = solved.equations
    jacobian = equations.jacobian(np.zeros(equations.layout.size))
    found = []
    for group, rows, factor in zip(equations.groups, equations.slices(), solved.factors, strict=True):
        own = solved.residuals[rows]
        taken = float(np.sum(_normal(jacobian[rows]) * solved.covariance))
        redundancy = own.size - taken
        grown = 1.0
        if redundancy > 0.2 * own.size:
            grown = robust.scale(own, redundancy) * _shared(group, own)
        found.append(max(factor * grown, LEAST_FACTOR))
    return tuple(found)


def _shared(group: Group, residuals: NDArray[np.float64]) -> float:
    """By how much errors that a view's distances share widen their deviation.

    Neighbouring pixels of a depth sensor err together, so that a thousand of them say less than a thousand would: what
    counts is how far the means of views scatter.
    """
    if not isinstance(group.measured, Planes):
        return 1.0
    views = group.views_of_rows
    counts = np.bincount(views)
    unit = residuals / max(float(np.sqrt(np.mean(residuals**2))), 1e-12)
    clipped = np.clip(unit, -robust.OUTLIER, robust.OUTLIER)
    excess = float(np.mean(np.bincount(views, clipped) ** 2 / np.maximum(counts, 1)))
    chance = 1 + 3 * np.sqrt(2 / len(counts))
    return float(np.sqrt(excess)) if excess > chance else 1.0


def _normal(jacobian: sparse.csr_array) -> NDArray[np.float64]:
    return (jacobian.T @ jacobian).toarray()


def _rms(residuals: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(robust.influence(residuals) ** 2)))


def rescale(equations: Equations, factors: tuple[float, ...]) -> Equations:
    """The same equations with the deviations of every group multiplied."""
    groups = [group.rescaled(factor) for group, factor in zip(equations.groups, factors, strict=True)]
    return replace(equations, groups=groups)
