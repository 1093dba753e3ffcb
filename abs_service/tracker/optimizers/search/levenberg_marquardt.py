"""The descent of Levenberg and Marquardt, as Nielsen damps it; no search by itself, because it only goes downhill."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, Outcome, Problem, Stop
from abs_service.tracker.posterior.curvature import Quadratic, solved

NAME = "levenberg_marquardt"

#: Damping after the first step that failed, and its growth with each further one, as a share of the curvature.
FIRST_DAMPING = 0.1
GROWTH = 10.0


def descend(problem: Problem, start: NDArray[np.float64], iterations: int, tolerance: float, budget: Budget) -> Outcome:
    """Goes downhill from start (dim,), one linearisation per step.

    Args:
        problem: the cost.
        start: where to begin (dim,).
        iterations: steps at most.
        tolerance: a step that promises a smaller decrease [nats] is the last: what would follow it is less by far.
        budget: evaluations and time; one step is tried at least.
    """
    theta, cost = start, float(problem.cost(start[None])[0])
    budget.spend(1)
    stop, damping, steps = None, 0.0, 0
    quadratic = problem.linearize(theta)
    while stop is None and steps < iterations:
        step, promise = _step(quadratic, damping)
        moved = float(problem.cost((theta + step)[None])[0])
        better = moved < cost
        budget.spend(1, generations=int(better))
        if better:
            theta, cost, damping, steps = theta + step, moved, damping / GROWTH, steps + 1
        stop = Stop.CONVERGED if promise < tolerance else budget.exhausted()
        if not better:
            damping = max(damping * GROWTH, FIRST_DAMPING)
        elif stop is None and steps < iterations:
            quadratic = problem.linearize(theta)
    return Outcome(theta, cost, NAME, stop or Stop.GENERATIONS, 0.0)


def _step(quadratic: Quadratic, damping: float) -> tuple[NDArray[np.float64], float]:
    """The damped step (dim,) and the decrease of cost that the quadratic promises for it [nats]."""
    damped = quadratic.curvature.copy()
    damped.flat[:: len(damped) + 1] *= 1 + damping
    step = -solved(damped, quadratic.gradient)
    return step, float(-step @ (quadratic.gradient + 0.5 * quadratic.curvature @ step))
