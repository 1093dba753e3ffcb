"""The descent goes downhill, as far as it promises something, and no longer than it may."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, Outcome, Stop
from abs_service.tracker.optimizers.search import levenberg_marquardt
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from tests.abs_service.tracker.optimizers.problems import Known, linear, minimize, rosenbrock

TARGET = np.array([0.3, -2.0, 1.0])


def budget(limit: int = 10**6, in_time=lambda: True) -> Budget:
    return Budget(limit, in_time)


def descend(problem: Known, start, steps: int, tolerance: float, budget: Budget) -> Outcome:
    return minimize(problem, levenberg_marquardt.descend(problem, start, steps, tolerance, budget), budget)


def counted(problem: Known) -> tuple[Known, list[NDArray[np.float64]]]:
    """The problem, and a list that every Θ enters at which it is linearised."""
    asked: list[NDArray[np.float64]] = []

    class Counted(Known):
        def linearize(self, theta: NDArray[np.float64]) -> LinearizedCost:
            asked.append(theta)
            return super().linearize(theta)

    return Counted(problem.dimension, problem.residuals, problem.outlier_share_at), asked


def test_one_step_solves_a_linear_problem_and_the_next_is_the_last():
    (problem, asked), spent = counted(linear(TARGET, np.array([1.0, 10.0, 100.0]))), budget()
    found = descend(problem, np.zeros(3), 5, 1e-6, spent)
    np.testing.assert_allclose(found.theta, TARGET, atol=1e-8)
    assert (found.stop, found.searcher, found.deviation) == (Stop.CONVERGED, "levenberg_marquardt", 0.0)
    assert (len(asked), spent.evaluations) == (2, 3)


def test_a_step_that_promises_little_is_taken_and_is_the_last():
    (problem, asked), spent = counted(linear(TARGET, np.ones(3))), budget()
    promise = 0.5 * float(TARGET @ TARGET)
    found = descend(problem, np.zeros(3), 5, 1.01 * promise, spent)
    np.testing.assert_allclose(found.theta, TARGET, atol=1e-8)
    assert (found.stop, spent.generations, spent.evaluations, len(asked)) == (Stop.CONVERGED, 1, 2, 1)


def test_steps_that_contract_end_before_the_one_that_would_promise_little():
    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return 100 * (x - TARGET) * (1 + 0.1 * (x - TARGET))

    (problem, asked), tolerance = counted(Known(3, residuals, lambda _: 0.0)), 1.0
    start = TARGET + 0.5
    promises = [problem.cost(theta[None])[0] for theta in _steps(problem, start, 3)]
    assert promises[1] > tolerance > promises[2]
    asked.clear()
    found = descend(problem, start, 5, tolerance, budget())
    assert (found.stop, len(asked)) == (Stop.CONVERGED, 2)
    assert found.cost < tolerance


def _steps(problem: Known, theta: NDArray[np.float64], count: int) -> list[NDArray[np.float64]]:
    """Parameters at which the first steps begin; without residuals at the end, a step promises all that there is."""
    found = [descend(problem, theta, steps, 1e-12, budget()).theta for steps in range(1, count)]
    return [theta, *found]


def test_a_step_that_promises_little_and_does_not_keep_it_is_not_taken():
    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([x - TARGET, np.where(np.abs(x).max(axis=1) > 0.1, 9.0, 0.0)])

    steep = Known(3, residuals, lambda _: 0.0)
    found = descend(steep, np.zeros(3), 5, 10.0, budget())
    assert found.stop == Stop.CONVERGED
    np.testing.assert_array_equal(found.theta, 0)


def test_a_refused_step_is_tried_shorter_only_if_it_promised_much():
    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([x - TARGET, np.where(np.abs(x).max(axis=1) > 0.1, 9.0, 0.0)])

    steep, promise = Known(3, residuals, lambda _: 0.0), 0.5 * float(TARGET @ TARGET)
    for share, evaluations in ((0.99, 2), (1.01, 3)):
        spent = budget(3)
        descend(steep, np.zeros(3), 5, promise / (share * levenberg_marquardt.REFUSED), spent)
        assert spent.evaluations == evaluations


def test_where_it_is_best_already_it_stays():
    spent = budget()
    found = descend(linear(TARGET, np.ones(3)), TARGET, 5, 1e-6, spent)
    np.testing.assert_allclose(found.theta, TARGET, atol=1e-9)
    assert (found.stop, spent.evaluations) == (Stop.CONVERGED, 2)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=4, max_size=4), st.integers(1, 12))
def test_it_never_climbs_and_tells_what_it_costs_there(start, steps):
    problem = rosenbrock(4)
    theta = np.array(start)
    found = descend(problem, theta, steps, 1e-9, budget())
    assert found.cost <= problem.cost(theta[None])[0]
    assert found.cost == problem.cost(found.theta[None])[0]


def test_a_bent_valley_is_followed_to_its_end():
    found = descend(rosenbrock(2), np.array([-1.2, 1.0]), 200, 1e-12, budget())
    np.testing.assert_allclose(found.theta, np.ones(2), atol=1e-4)


@pytest.mark.parametrize("limit", [1, 3, 7])
def test_evaluations_are_kept_within_the_budget_but_for_one_try(limit):
    spent = budget(limit)
    found = descend(rosenbrock(4), np.full(4, -1.2), 100, 1e-12, spent)
    assert found.stop == Stop.EVALUATIONS
    assert spent.evaluations == max(limit, 2)


def test_it_ends_when_time_is_up():
    looks = iter([True, True, False])
    found = descend(rosenbrock(4), np.full(4, -1.2), 100, 1e-12, budget(in_time=lambda: next(looks)))
    assert found.stop == Stop.TIME


def test_a_cost_without_a_number_is_not_better():
    problem = linear(TARGET, np.ones(3))
    cliff = type(problem)(3, lambda x: np.where(x[:, :1] > 0.1, np.nan, 1.0) * (x - TARGET), lambda theta: 0.0)
    found = descend(cliff, np.zeros(3), 3, 1e-6, budget(40))
    assert found.theta[0] <= 0.1
    assert found.cost < cliff.cost(np.zeros((1, 3)))[0]
