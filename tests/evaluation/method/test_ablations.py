"""The ablations in seconds: more budget, warm starts and a right σ are worth what they should be."""

import numpy as np
import pytest

from abs_service.tracker.optimizers import hybrid
from abs_service.tracker.optimizers.base import Budget, Optimizer
from evaluation.experiment import Context
from evaluation.method import ablations
from evaluation.method.ablations import plain_cma
from evaluation.method.ablations.cold_start import Cold, Forgetful
from tests.abs_service.tracker.optimizers.problems import linear, minimize

TARGET = np.array([1.0, -2.0])


def starts(optimizer: Optimizer) -> list[float]:
    """Evaluations that frames need which begin at the target."""
    problem, needed = linear(TARGET, np.ones(2)), []
    budget = Budget(10**6, lambda: True)
    minimize(problem, optimizer.explore(problem, np.zeros(2), budget), budget)
    for _ in range(2):
        budget = Budget(10**6, lambda: True)
        found = minimize(problem, optimizer.follow(problem, TARGET, budget), budget)
        np.testing.assert_allclose(found.theta, TARGET, atol=1e-3)
        needed.append(budget.generations)
    return needed


def test_a_cold_search_begins_where_the_first_frame_began():
    warm = starts(Forgetful(hybrid.Settings(tolerance=1e-6)).build(2, np.random.default_rng(0)))
    cold = starts(Cold(hybrid.Settings(tolerance=1e-6)).build(2, np.random.default_rng(0)))
    assert warm[0] == warm[1] < cold[0] == cold[1]


@pytest.mark.parametrize("begin", [plain_cma.in_theta, plain_cma.after_newton, plain_cma.in_metric])
def test_every_way_to_begin_ends_at_the_minimum(begin: plain_cma.Begin):
    problem, budget = linear(0.1 * TARGET, np.full(2, 1e3)), Budget(10**6, lambda: True)
    search = plain_cma.Settings(begin, population=12, generations=200).build(2, np.random.default_rng(0))
    found = minimize(problem, search.explore(problem, np.zeros(2), budget), budget)
    np.testing.assert_allclose(found.theta, 0.1 * TARGET, atol=3e-3)


def test_a_newton_step_is_at_the_minimum_of_a_linear_problem():
    problem = linear(TARGET, np.ones(2))
    origins = plain_cma.after_newton(problem, np.zeros(2))[0]
    np.testing.assert_allclose(origins, np.outer([0, 0.5, 1], TARGET), atol=1e-6)
    np.testing.assert_allclose(plain_cma.in_theta(problem, TARGET)[0], TARGET[None])


def test_the_paper_s_search_starts_at_the_last_solution_and_not_at_the_prediction():
    problem = linear(TARGET, np.ones(2))
    search = plain_cma.FromLast(hybrid.Settings(tolerance=1e-9)).build(2, np.random.default_rng(0))
    budget = Budget(10**6, lambda: True)
    found = minimize(problem, search.explore(problem, np.zeros(2), budget), budget)
    first = next(search.follow(problem, np.array([50.0, 50.0]), budget))
    np.testing.assert_allclose(first[0], found.theta, atol=1e-6)


@pytest.mark.slow
def test_every_part_is_worth_what_it_should_be():
    values = ablations.run(ablations.QUICK, Context(0)).values
    parts = values["CMA-ES as in the paper, and with each addition"]
    default = parts["hybrid, begun where images show the print: the default"]
    assert default["vertex_mm"] < parts["plain, from the last solution"]["vertex_mm"] / 2
    warm, *_, cold = values["Warm start of CMA-ES, 20 generations"].values()
    assert warm["vertex_mm"] < cold["vertex_mm"]
    variances = [figures["residual_variance"] for figures in values["Noise model of distances"].values()]
    half, right, double = variances[:3]
    assert right == pytest.approx(1, abs=0.2)
    assert half > 2.5
    assert double < 0.4
    assert values["Priors, NURBS"]["all"]["vertex_mm"] < 2
