"""Our CMA-ES is pycma's in distribution: the same costs after the same generations, whoever draws the numbers."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import mannwhitneyu

from abs_service.tracker.optimizers.cma import PycmaSampler
from abs_service.tracker.optimizers.cma_es import CmaEsSampler
from abs_service.tracker.optimizers.search.ask_and_tell import Sampler, default_population

DIMENSION = 8
RUNS = 24
AXES = 10.0 ** np.linspace(-1, 1, DIMENSION)

#: Costs of candidates (population, dim) and the generations after which they are compared.
FUNCTIONS: dict[str, tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], tuple[int, ...]]] = {
    "sphere": (lambda x: np.sum((x - 1) ** 2, axis=1), (20, 60)),
    "ellipsoid": (lambda x: np.sum((AXES * (x - 1)) ** 2, axis=1), (60, 160)),
    "turned ellipsoid": (lambda x: np.sum((AXES * ((x - 1) @ TURN)) ** 2, axis=1), (60, 160)),
    "rosenbrock": (lambda x: np.sum(100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2, axis=1), (60, 160)),
    "cigar": (lambda x: x[:, 0] ** 2 + 1e4 * np.sum((x[:, 1:] - 1) ** 2, axis=1), (60, 160)),
    "different powers": (lambda x: np.sum(np.abs(x - 1) ** np.linspace(2, 6, DIMENSION), axis=1), (60, 120)),
}
TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(DIMENSION, DIMENSION)))[0]


def logarithms(make: Callable[..., Sampler], function: str) -> NDArray[np.float64]:
    """Logarithms of the mean's cost and of the step size (runs, 2 · moments) along the way."""
    cost, moments = FUNCTIONS[function]
    found = np.zeros((RUNS, 2 * len(moments)))
    for run in range(RUNS):
        strategy = make(DIMENSION, np.random.default_rng([run, 7]), 0.5, default_population(DIMENSION), 0.5)
        column = 0
        for generation in range(1, moments[-1] + 1):
            strategy.tell(cost(strategy.ask()))
            if generation in moments:
                found[run, column : column + 2] = np.log([cost(strategy.mean[None])[0], strategy.deviation])
                column += 2
    return found


@pytest.mark.slow
@pytest.mark.parametrize("function", FUNCTIONS)
def test_costs_and_step_sizes_are_distributed_as_pycma_s(function):
    ours, theirs = logarithms(CmaEsSampler, function), logarithms(PycmaSampler, function)
    p = [mannwhitneyu(a, b).pvalue for a, b in zip(ours.T, theirs.T)]
    print(
        function, "medians", np.median(ours, axis=0).round(2), np.median(theirs, axis=0).round(2), "p", np.round(p, 3)
    )
    assert min(p) > 0.05 / 24  # at a level of 5 % for all 24 comparisons together; equal seeds keep the outcome
