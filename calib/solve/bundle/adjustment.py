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

from calib.solve.bundle import robust
from calib.solve.bundle.blocks import Planes
from calib.solve.bundle.equations import Equations, Group
from calib.solve.bundle.layout import Layout
from calib.solve.bundle.observability import require_determined, require_touched
from calib.solve.bundle.state import State

#: Given the equations at a state, with the deviations found so far.
Formulate = Callable[[State, tuple[float, ...]], Equations]

#: Searches with deviations of the groups estimated in between.
ROUNDS = 3

#: Steps until the metric is taken anew, and how often that is done: far from the minimum its metric is another.
STEPS = 25
STAGES = 12

#: A stage that lowers the cost by less than this was the last: a tenth of a deviation of the least known parameter.
LEAST_GAIN = 0.005

#: Added to the metric, as a share of each parameter's own: a rational lens without distortion is no direction twice.
DAMPING = 1e-10

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
    if not np.all(np.isfinite(equations.residuals(np.zeros(equations.layout.size)))):
        raise NotSolvedError("the first guess puts a board behind a camera that saw it; check the given calibration")
    for _ in range(STAGES):
        increments, ended = _stage(equations)
        equations = replace(equations, base=equations.layout.move(equations.base, increments))
        if ended:
            return equations.base
    raise NotSolvedError(
        f"no minimum after {STAGES * STEPS} steps: the views contradict each other, or the kind of lens does not fit"
    )


def _stage(equations: Equations) -> tuple[NDArray[np.float64], bool]:
    """Increments after some steps in the metric of the curvature at their start, and whether that is the minimum."""
    start = np.zeros(equations.layout.size)
    residuals = equations.residuals(start)
    # Weighted as the loss weighs the residuals there, so that a few gross errors do not shape the metric.
    weights = sparse.diags_array(np.sqrt(robust.influence(residuals) / np.where(residuals == 0, 1, residuals)))
    curvature = require_touched(_normal(weights @ equations.jacobian(start)), equations.layout.names)
    factor = linalg.cholesky(curvature + DAMPING * np.diag(np.diag(curvature)), lower=True)
    metric = linalg.solve_triangular(factor.T, np.eye(len(factor)))

    def derivatives(steps: NDArray[np.float64]) -> Any:  # SciPy's product of operators is no public type
        return aslinearoperator(equations.jacobian(metric @ steps)) @ aslinearoperator(metric)

    found = least_squares(
        lambda steps: equations.residuals(metric @ steps),
        start,
        jac=derivatives,  # pyright: ignore[reportArgumentType]
        method="trf",
        tr_solver="lsmr",
        loss="soft_l1",
        f_scale=robust.SOFT_L1_SCALE,
        ftol=1e-8,  # a cost of n / 2 then ends within a hundredth of a deviation
        xtol=1e-10,
        gtol=1e-3,  # of a deviation, since the metric is that of the curvature
        max_nfev=STEPS,
    )
    gained = _cost(residuals) - float(found.cost)
    return metric @ found.x, found.status > 0 or gained < LEAST_GAIN


def _cost(residuals: NDArray[np.float64]) -> float:
    """Half the sum of the loss, as SciPy counts it."""
    scale = robust.SOFT_L1_SCALE
    return float(np.sum(scale**2 * (np.sqrt(1 + (residuals / scale) ** 2) - 1)))


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
