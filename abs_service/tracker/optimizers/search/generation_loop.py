"""Generations of CMA-ES in one compiled loop, whose threads part for the candidates only."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.fused_cost import NOTHING
from abs_service.tracker.optimizers.search.cma_update import absorb, propose, update
from abs_service.tracker.optimizers.search.convergence import enter
from calib.jit import kernel, prange


class Distribution(NamedTuple):
    """What candidates are drawn from, and what is learnt for it; arrays that generations change.

    Attributes:
        mean: (dim,).
        axes: what leads from normal numbers z to Θ, a row for each (dim, dim).
        learnt: covariance in the coordinates of z (dim, dim).
        factor: lower Cholesky factor (dim, dim) of the covariance of ξ when these coordinates were made.
        paths: of the step size and of the covariance, in the coordinates of z (2, dim).
    """

    mean: NDArray[np.float64]
    axes: NDArray[np.float32]
    learnt: NDArray[np.float32]
    factor: NDArray[np.float64]
    paths: NDArray[np.float64]


#: A cost in whose place `composed` puts a problem's.
judged: Callable[..., float] = NOTHING.kernel


@kernel
def generations(
    distribution: Distribution,
    weights: NDArray[np.float64],
    rates: NDArray[np.float64],
    generation: int,
    gap: int,
    sigma: float,
    bits: NDArray[np.uint16],
    quantiles: NDArray[np.float32],
    least: NDArray[np.float64],
    done: int,
    tolerance: float,
    arguments: tuple[Any, ...],
) -> tuple[int, float, bool]:
    """Draws, judges and learns, for as many generations as there are bits, or until costs are steady.

    Args:
        distribution: is changed.
        weights, rates: see `Constants`.
        generation: how many have taught `distribution` something before.
        gap: generations from one set of coordinates to the next.
        sigma: step size.
        bits: random (generations · population · dim,).
        quantiles: see `normal_quantiles`.
        least: best cost of every generation of the search; those that are done, and results.
        done: how many that are.
        tolerance: see `enter`.
        arguments: of `judged`, after the candidate.

    Returns:
        How many generations are done then, the step size, whether costs are steady.
    """
    mean, axes, learnt, factor, paths = distribution
    population, n, steady = weights.size, mean.size, False
    z, thetas, costs = np.empty((population, n), np.float32), np.empty((population, n)), np.empty(population)
    for first in range(0, bits.size, z.size):
        propose(bits[first : first + z.size], quantiles, axes, sigma, mean, z, thetas)
        for k in prange(population):
            costs[k] = judged(thetas[k : k + 1], *arguments)
        generation += 1
        sigma = update(z, axes, costs, weights, rates, generation, sigma, mean, paths, learnt)
        if generation % gap == 0:
            absorb(learnt, factor, paths[1], axes)
        steady = enter(costs, least, done, tolerance)
        done += 1
        if steady:
            break
    return done, sigma, steady
