"""Robust nonlinear least squares with estimated variance components.

SciPy's trust-region solver runs in coordinates scaled by the curvature at its start (as in the tracker's search, see
docs/decisions): focal lengths in pixels, lens coefficients and metres then have similar scale and are nearly
uncorrelated, and the inner solver needs a dozen products with the sparse Jacobian instead of thousands.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.optimize import least_squares
from scipy.sparse.linalg import aslinearoperator

from calib.solve.bundle import robust, uncertainty, variance_components
from calib.solve.bundle.bent_boards import bend_covariance
from calib.solve.bundle.equations import DAMPING, Equations
from calib.solve.bundle.observability import require_determined, require_touched
from calib.solve.bundle.parameters.layout import Layout
from calib.solve.bundle.parameters.state import State

#: Builds the equations about a state, given the deviations estimated so far.
Formulate = Callable[[State, tuple[float, ...]], Equations]

#: Optimisations, with the deviations of the groups re-estimated in between.
ROUNDS = 3

#: Steps per stage, and maximum number of stages; the curvature is recomputed for every stage.
STEPS = 25
STAGES = 12

NO_MINIMUM = (
    f"no minimum after {STAGES * STEPS} steps: the views contradict each other, or the kind of lens does not fit"
)

#: Convergence: smallest decrease of the cost in a stage, a tenth of a deviation of the worst determined parameter.
#: Deviations are as large as the residuals say: before the first estimate they may be many times too small.
MIN_GAIN = 0.005

#: Largest gradient at a minimum, in deviations of the scaled parameters; they likewise grow with the residuals. Found
#: minima have 0.003; where a search ends because beyond are lenses without an inverse, it is 100 to 500.
MAX_GRADIENT = 3.0

#: Lower bound of a group's deviation factor.
MIN_FACTOR = 0.01


class NotSolvedError(ValueError):
    """The optimisation did not converge.

    Args:
        message: the reason, for people.
        unfinished: where it ended, from which shots that contradict the rest can be found; None if it could not begin.
    """

    def __init__(self, message: str, unfinished: "Adjustment | None" = None) -> None:
        self.unfinished = unfinished
        super().__init__(message)


@dataclass(frozen=True)
class Adjustment:
    """Minimum of the cost with its covariances.

    Attributes:
        equations: at the minimum: `base` is the solution; deviations are the estimated ones.
        factors: estimated factor on the deviations of every group.
        independent: covariance of increments of the parameters, if all errors were independent (size, size).
        residuals: normalised by the estimated deviations (n,).
    """

    equations: Equations
    factors: tuple[float, ...]
    independent: NDArray[np.float64]
    residuals: NDArray[np.float64]

    @property
    def state(self) -> State:
        """Solution."""
        return self.equations.base

    @property
    def layout(self) -> Layout:
        """Parameter vector."""
        return self.equations.layout

    @cached_property
    def noise(self) -> NDArray[np.float64]:
        """Covariance of the sensors' parameters (k, k), if noise were the only error and no pose were repeated."""
        return uncertainty.noise_covariance(
            self.pose_information, variance_components.covariance_inflation(self.equations, self.residuals)
        )

    @cached_property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of increments of the parameters (size, size).

        From how far the poses of the board disagree, and what a bend of the board does to all of them alike.
        """
        if self.layout.board_start == 0:
            return self.independent
        sensors = self.between_poses + bend_covariance(self.equations, self.residuals)
        return uncertainty.with_boards(self.independent, sensors)

    @cached_property
    def between_poses(self) -> NDArray[np.float64]:
        """Covariance of the sensors' parameters (k, k), from how far the poses of the board disagree."""
        return uncertainty.pose_covariance(self.pose_information, self.noise)

    @cached_property
    def pose_information(self) -> uncertainty.PoseInformation:
        """Information and scores of the distinct poses."""
        return uncertainty.pose_information(self.equations, self.residuals)


def adjust(formulate: Formulate, start: State, groups: int, note: Callable[[str], None]) -> Adjustment:
    """State that minimises the robust cost.

    Raises:
        UndeterminedError: the measurements do not determine some parameters.
        NotSolvedError: no convergence, or the initial state is infeasible.
    """
    factors = (1.0,) * groups
    found = _round(formulate, start, factors)
    for number in range(1, ROUNDS):
        note(f"round {number} of {ROUNDS}: {_rms(found.residuals):.2f} deviations rms")
        found = _round(formulate, found.state, _updated_factors(found))
    note(f"round {ROUNDS} of {ROUNDS}: {_rms(found.residuals):.2f} deviations rms")
    return found


def _round(formulate: Formulate, start: State, factors: tuple[float, ...]) -> Adjustment:
    state, converged = _search(formulate(start, factors))
    equations = formulate(state, factors)
    found = Adjustment(equations, factors, *_covariance(equations))
    if not converged:
        raise NotSolvedError(NO_MINIMUM, found)
    return found


def search(equations: Equations) -> State:
    """State that minimises the robust cost of the equations.

    Raises:
        UndeterminedError, NotSolvedError: as in `adjust`.
    """
    state, converged = _search(equations)
    if not converged:
        raise NotSolvedError(NO_MINIMUM)
    return state


def _search(equations: Equations) -> tuple[State, bool]:
    """The best state after at most `STAGES` stages; True if it is a minimum."""
    if not np.all(np.isfinite(equations.residuals(np.zeros(equations.layout.size)))):
        raise NotSolvedError("the first guess puts a board behind a camera that saw it; check the given calibration")
    converged = False
    for _ in range(STAGES):
        increments, converged = _stage(equations)
        equations = replace(equations, base=equations.layout.move(equations.base, increments))
        if converged:
            break
    return equations.base, converged


def _stage(equations: Equations) -> tuple[NDArray[np.float64], bool]:
    """Increments after at most `STEPS` steps in coordinates scaled by the curvature; True if converged."""
    start = np.zeros(equations.layout.size)
    residuals = equations.residuals(start)
    first = equations.base_jacobian
    # Weighted like the robust loss, so that a few gross errors do not dominate the curvature.
    weights = sparse.diags_array(np.sqrt(robust.influence(residuals) / np.where(residuals == 0, 1, residuals)))
    curvature = require_touched(_normal(weights @ first), equations.layout.names)
    factor = linalg.cholesky(curvature + DAMPING * np.diag(np.diag(curvature)), lower=True)
    metric = linalg.solve_triangular(factor.T, np.eye(len(factor)))

    def derivatives(steps: NDArray[np.float64]) -> Any:  # SciPy's operator product has no public type
        jacobian = equations.jacobian(metric @ steps) if steps.any() else first
        return aslinearoperator(jacobian) @ aslinearoperator(metric)

    found = least_squares(
        lambda steps: equations.residuals(metric @ steps),
        start,
        jac=derivatives,  # pyright: ignore[reportArgumentType]
        method="trf",
        tr_solver="lsmr",
        loss="soft_l1",
        f_scale=robust.SOFT_L1_SCALE,
        ftol=1e-8,  # relative to a cost of n / 2: about a hundredth of a deviation
        xtol=1e-10,
        gtol=1e-3,  # in deviations, because the coordinates are scaled by the curvature
        max_nfev=STEPS,
    )
    gained = _cost(residuals) - float(found.cost)
    variance = max(1.0, 2 * float(found.cost) / len(residuals))
    flat = float(found.optimality) < MAX_GRADIENT * np.sqrt(variance)
    return metric @ found.x, flat and (found.status > 0 or gained < MIN_GAIN * variance)


def _cost(residuals: NDArray[np.float64]) -> float:
    """Robust cost as defined by SciPy: half the sum of the loss."""
    scale = robust.SOFT_L1_SCALE
    return float(np.sum(scale**2 * (np.sqrt(1 + (residuals / scale) ** 2) - 1)))


def _covariance(equations: Equations) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance of the increments, and normalised residuals, at the equations' base."""
    residuals = equations.residuals(np.zeros(equations.layout.size))
    curvature = require_determined(_normal(equations.base_jacobian), equations.layout.names)
    inflation = variance_components.covariance_inflation(equations, residuals)
    return inflation * uncertainty.scaled_inverse(curvature), residuals


def _updated_factors(solved: Adjustment) -> tuple[float, ...]:
    """Updated deviation factors of the groups, from their residuals (variance component estimation)."""
    equations = solved.equations
    found = []
    for group, rows, factor in zip(equations.groups, equations.slices(), solved.factors, strict=True):
        own = solved.residuals[rows]
        taken = float(np.sum(_normal(equations.base_jacobian[rows]) * solved.independent))
        redundancy = own.size - taken
        grown = 1.0
        if redundancy > 0.2 * own.size:
            grown = robust.scale(own, redundancy) * variance_components.correlation_inflation(group, own)
        found.append(max(factor * grown, MIN_FACTOR))
    return tuple(found)


def _normal(jacobian: sparse.csr_array) -> NDArray[np.float64]:
    return (jacobian.T @ jacobian).toarray()


def _rms(residuals: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(robust.influence(residuals) ** 2)))
