"""Convergence of a search by generations."""

import numpy as np

from abs_service.tracker.optimizers.search.convergence import PATIENCE, ConvergenceMonitor


def feed(monitor: ConvergenceMonitor, generations: list[list[float]]) -> int:
    """Number of generations that the monitor takes before the search is over."""
    for count, costs in enumerate(generations):
        if monitor.is_over:
            return count
        monitor.add(np.array(costs))
    return len(generations)


def test_equal_costs_converge_after_the_patience():
    monitor = ConvergenceMonitor(100, 0.1)
    assert feed(monitor, [[1.0, 1.05]] * 20) == PATIENCE
    assert monitor.converged


def test_costs_that_differ_within_a_generation_do_not_converge():
    monitor = ConvergenceMonitor(100, 0.1)
    assert feed(monitor, [[1.0, 1.2]] * 20) == 20
    assert not monitor.converged


def test_falling_minima_do_not_converge_until_they_agree():
    monitor = ConvergenceMonitor(100, 0.1)
    falling = [[10.0 - k, 10.0 - k] for k in range(6)]
    assert feed(monitor, falling + [[4.0, 4.0]] * 20) == len(falling) + PATIENCE
    assert monitor.converged


def test_the_maximum_number_of_generations_ends_the_search():
    monitor = ConvergenceMonitor(7, 0.0)
    assert feed(monitor, [[float(k), 0.0] for k in range(20)]) == 7
    assert not monitor.converged
