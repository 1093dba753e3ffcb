"""Generations in one compiled loop are those that ask and tell make of the same random bits."""

import numpy as np
import pytest

from abs_service.tracker.fused_cost import Step
from abs_service.tracker.optimizers.base import Budget
from abs_service.tracker.optimizers.cma_es import AT_ONCE, CmaEs
from abs_service.tracker.optimizers.search.convergence import PATIENCE, Course
from calib.jit import kernel
from tests.tracker.problems import Known

DIMENSION, POPULATION = 7, 12
AXES = np.linspace(1, 3, DIMENSION)


@kernel
def ellipsoid(theta, axes):
    total = 0.0
    for j in range(axes.size):
        total += 0.5 * (axes[j] * (theta[0, j] - 1)) ** 2
    return total


STEP = Step(ellipsoid, (AXES,))


def problem(judge: Step | None) -> Known:
    return Known(DIMENSION, lambda thetas: AXES * (thetas - 1), lambda theta: 0.0, judge=judge)


def strategy(seed: int = 3) -> CmaEs:
    made = CmaEs(DIMENSION, np.random.default_rng(seed), 0.5, POPULATION, 1.0)
    made.restart(np.zeros(DIMENSION), np.eye(DIMENSION))
    return made


def run(judge: Step | None, course: Course, budget: Budget, seed: int = 3) -> CmaEs:
    found = strategy(seed)
    while course.left and not budget.exhausted():
        found.advance(problem(judge), course, budget)
    return found


def everlasting(limit: int = 10**9) -> Budget:
    return Budget(limit, lambda: True)


@pytest.mark.parametrize("generations", [1, 20, AT_ONCE // POPULATION, 90])
def test_the_loop_searches_as_asking_and_telling_do(generations):
    courses = Course(generations, 0.0), Course(generations, 0.0)
    budgets = everlasting(), everlasting()
    one, other = (run(judge, *spent) for judge, spent in zip((STEP, None), zip(courses, budgets)))
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(one.deviation, other.deviation, rtol=1e-3)
    np.testing.assert_allclose(courses[0].least, courses[1].least, rtol=1e-2, atol=1e-9)
    for budget in budgets:
        assert (budget.generations, budget.evaluations) == (generations, generations * POPULATION)


@pytest.mark.parametrize("judge", [STEP, None], ids=["in one loop", "asked and told"])
def test_it_ends_when_costs_are_steady(judge):
    course, budget = Course(500, 1e-3), everlasting()
    found = run(judge, course, budget)
    assert course.steady
    assert PATIENCE < course.done == budget.generations < 200
    assert np.ptp(course.least[course.done - PATIENCE : course.done]) < 1e-3
    np.testing.assert_allclose(found.mean, 1, atol=0.05)
    assert course.left == 0


@pytest.mark.parametrize("judge", [STEP, None], ids=["in one loop", "asked and told"])
def test_no_generation_begins_when_evaluations_are_spent(judge):
    budget = everlasting(30)
    run(judge, Course(500, 0.0), budget)
    assert (budget.generations, budget.evaluations) == (3, 36)


def test_it_looks_at_the_clock_after_so_many_candidates():
    looks = iter([True] * 4 + [False])  # before each block, and within, since what is late anyway judges one generation
    budget = Budget(10**9, lambda: next(looks))
    run(STEP, Course(500, 0.0), budget)
    assert budget.evaluations == 2 * (AT_ONCE // POPULATION) * POPULATION


def test_what_is_late_anyway_judges_one_generation():
    course, budget = Course(500, 0.0), Budget(10**9, lambda: False)
    strategy().advance(problem(STEP), course, budget)
    assert (course.done, budget.evaluations) == (1, POPULATION)


def test_one_generation_at_once_needs_no_loop():
    """Nothing of it is compiled for the problem, which then need not be a kernel."""
    made = CmaEs(DIMENSION, np.random.default_rng(1), 0.5, POPULATION, 1.0, at_once=1)
    budget, course = everlasting(), Course(10, 0.0)
    made.advance(problem(Step(lambda theta: np.nan)), course, budget)
    assert (course.done, budget.evaluations) == (1, POPULATION)
    assert np.isfinite(course.least[0])


@pytest.mark.parametrize("population", [AT_ONCE, AT_ONCE + 1])
def test_a_large_population_is_judged_as_a_whole(population):
    made = CmaEs(DIMENSION, np.random.default_rng(1), 0.5, population, 1.0)
    budget, course = everlasting(), Course(10, 0.0)
    made.advance(problem(STEP), course, budget)
    assert (course.done, budget.evaluations) == (1, population)
