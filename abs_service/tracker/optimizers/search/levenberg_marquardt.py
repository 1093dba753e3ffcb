"""Levenberg–Marquardt descent with Nielsen's damping; a local search."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, FrameProblem, Outcome, Search, Stop
from abs_service.tracker.posterior.curvature import Quadratic, solved

NAME = "levenberg_marquardt"

#: Damping after the first failed step, and its growth with each further one, as a share of the curvature.
FIRST_DAMPING = 0.1
GROWTH = 10.0

#: A refused step is tried shorter only if it promised more than so many tolerances. Which pixels vertices fall on moves
#: the cost of a frame by some nats, so that nothing less tells a step that is too long from one that is not.
REFUSED = 3.0


def descend(
    problem: FrameProblem, start: NDArray[np.float64], iterations: int, tolerance: float, budget: Budget
) -> Search:
    """Descends from start (dim,), one linearisation per accepted step.

    Steps contract: the decrease after a step is foretold from those of this step and the one before, as codes for
    stiff equations end Newton's method (E. Hairer, G. Wanner: Solving Ordinary Differential Equations II, IV.8).

    Args:
        problem: the cost.
        start: initial parameters (dim,).
        iterations: maximum number of accepted steps.
        tolerance: a step is the last one if the decrease predicted for it, or for the step after it, is smaller [nats];
            a refused one, if it is smaller than `REFUSED` tolerances.
        budget: evaluations and time; at least one step is tried.
    """
    theta, cost = start, float((yield start[None])[0])
    stop, damping, steps, before = None, 0.0, 0, 0.0
    linearized = problem.linearize(theta)
    while stop is None and steps < iterations:
        step, decrease = _step(linearized.quadratic, damping)
        cost_after = float((yield (theta + step)[None])[0])
        better = cost_after < cost
        if better:
            theta, cost, damping, steps = theta + step, cost_after, damping / GROWTH, steps + 1
            budget.generations += 1
        minimum = tolerance if better else REFUSED * tolerance
        ends = decrease < minimum or (better and decrease**2 < tolerance * before)
        stop = Stop.CONVERGED if ends else budget.exhausted()
        before = decrease if better and not damping else 0.0
        if not better:
            damping = max(damping * GROWTH, FIRST_DAMPING)
        elif stop is None and steps < iterations:
            linearized = problem.linearize(theta)
    return Outcome(theta, cost, NAME, stop or Stop.GENERATIONS, 0.0, linearized)


def _step(quadratic: Quadratic, damping: float) -> tuple[NDArray[np.float64], float]:
    """Damped step (dim,) and the decrease of cost that the quadratic predicts for it [nats]."""
    damped = quadratic.curvature.copy()
    damped.flat[:: len(damped) + 1] *= 1 + damping
    step = -solved(damped, quadratic.gradient)
    return step, float(-step @ (quadratic.gradient + 0.5 * quadratic.curvature @ step))
