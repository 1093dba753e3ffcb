"""Hybrid search: descent while it explains the measurements, CMA-ES otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracker.optimizers.base import Budget, Outcome, Stop
from abs_service.tracker.terms.sensor_fit import Remainder
from abs_service.tracker.terms.vertex_counts import VertexCounts
from tests.abs_service.tracker.optimizers.problems import Known, linear, minimize, two_wells

FAR = np.array([1.5, -1.5, 1.5, -1.5])
NEAR = linear(np.full(4, 0.2), np.geomspace(1, 100, 4))


def search(seed: int = 1, **settings: object) -> hybrid.Hybrid:
    return hybrid.Settings(**settings).build(4, np.random.default_rng(seed))  # pyright: ignore[reportArgumentType]


def follow(optimizer, problem: Known, limit: int = 10**6) -> tuple[Outcome, Budget]:
    budget = Budget(limit, lambda: True)
    return minimize(problem, optimizer.follow(problem, np.zeros(4), budget), budget), budget


def explore(optimizer, problem: Known) -> tuple[Outcome, Budget]:
    budget = Budget(10**6, lambda: True)
    return minimize(problem, optimizer.explore(problem, np.zeros(4), budget), budget), budget


def test_what_is_near_is_descended_to():
    optimizer = search()
    explore(optimizer, NEAR)
    found, budget = follow(optimizer, NEAR)
    assert found.searcher == "levenberg_marquardt"
    np.testing.assert_allclose(found.theta, 0.2, atol=0.5)
    assert budget.evaluations <= 4


def test_what_is_left_may_lie_in_a_single_direction_and_is_less_than_its_deviation():
    """A bent valley of the first two of 48 parameters, along which the cost falls by 7.6 nats."""

    def residuals(thetas):
        x, y = thetas[:, 0] - 0.3, thetas[:, 1] + 0.3**2
        return np.concatenate([3 * np.stack([y - x**2, 1 - x], axis=1), thetas[:, 2:]], axis=1)

    valley, budget = Known(48, residuals, lambda theta: 0.0), Budget(10**6, lambda: True)
    optimizer = hybrid.Settings().build(48, np.random.default_rng(1))
    found = minimize(valley, optimizer.follow(valley, np.zeros(48), budget), budget)
    assert found.cost < 0.5


def test_cma_es_takes_over_when_the_descent_explains_less_than_lately():
    optimizer = search()
    explore(optimizer, NEAR)
    found, budget = follow(optimizer, two_wells(FAR))
    assert found.searcher == "cma_es"
    np.testing.assert_allclose(found.theta, FAR, atol=0.2)
    assert budget.evaluations > 20
    again, _ = follow(optimizer, NEAR)
    assert again.searcher == "levenberg_marquardt"


def test_where_images_show_the_surface_another_search_begins_before_cma_es():
    optimizer = search()
    explore(optimizer, NEAR)
    found, budget = follow(optimizer, replace(two_wells(FAR), shown=FAR))
    assert found.is_start
    assert found.theta is FAR
    assert budget.evaluations < 20
    assert not found.fits  # those of the end of the descent


@pytest.mark.parametrize(("share", "sampled"), [(0.04, False), (0.5, True)])
def test_nothing_is_sampled_where_images_show_the_surface_at_the_end_of_the_descent_unless_distances_disagree(
    share, sampled
):
    class Here(Known):
        def shown_at(self, theta):
            return theta

        def fits(self, theta):
            (distances,) = super().fits(theta)
            colors = replace(distances, sensor="color", inliers=40, counts=VertexCounts(agreeing=40, disagreeing=60))
            return replace(distances, remainder=Remainder(at_first=0.0)), colors

    optimizer = search()
    explore(optimizer, NEAR)
    found, budget = follow(optimizer, Here(4, NEAR.residuals, lambda theta: share))
    assert not found.is_start
    assert (budget.evaluations > 20) == sampled


def test_nothing_is_looked_for_when_the_time_is_up():
    optimizer = search()
    explore(optimizer, NEAR)
    problem, late = replace(two_wells(FAR), shown=FAR), Budget(10**6, lambda: False)
    assert not minimize(problem, optimizer.follow(problem, np.zeros(4), late), late).is_start


def test_what_cma_es_finds_is_not_taken_if_it_is_no_better():
    optimizer = search()
    explore(optimizer, NEAR)
    nowhere = Known(4, NEAR.residuals, lambda theta: 0.5)
    found, budget = follow(optimizer, nowhere)
    assert found.searcher == "levenberg_marquardt"
    assert budget.evaluations > 20


def test_a_search_in_vain_ends_and_a_new_change_begins_another():
    optimizer = search()
    explore(optimizer, NEAR)
    worse = Known(4, NEAR.residuals, lambda theta: 0.2)
    efforts = [follow(optimizer, worse)[1].evaluations for _ in range(120)]
    assert efforts[0] > 20
    assert efforts[-1] <= 4
    worst = Known(4, NEAR.residuals, lambda theta: 0.4)
    assert follow(optimizer, worst)[1].evaluations > 20


def test_tries_in_vain_pause_until_the_share_rises_again():
    """A hand that takes hold of the object hides a part of it for seconds; samples find nothing in its place."""
    optimizer = search()
    explore(optimizer, NEAR)
    held, turned = (Known(4, NEAR.residuals, lambda theta, share=share: share) for share in (0.5, 0.6))
    sampled = [follow(optimizer, held)[1].evaluations > 20 for _ in range(24)]
    assert np.flatnonzero(sampled).tolist() == [0, 1, 2, 3, 5, 9, 17]
    assert follow(optimizer, turned)[1].evaluations > 20
    assert follow(optimizer, NEAR)[1].evaluations <= 4
    assert follow(optimizer, held)[1].evaluations > 20


def test_the_budget_bounds_both():
    optimizer = search(population=8)
    explore(optimizer, NEAR)
    found, budget = follow(optimizer, two_wells(FAR), limit=10)
    assert found.stop == Stop.EVALUATIONS
    assert budget.evaluations < 10 + 8 + 8  # a generation that has begun is completed, and then polished once


@pytest.mark.parametrize("module", [cma, cma_es, hybrid], ids=["cma", "cma_es", "hybrid"])
def test_exploring_finds_what_following_does_not(module):
    problem = two_wells(1.5 * FAR)
    optimizer = module.Settings().build(4, np.random.default_rng(3))
    narrow = (
        module.Settings(step=0.01).build(4, np.random.default_rng(3))
        if module is not hybrid
        else search(fallback_above=0.9)
    )
    stayed, _ = follow(narrow, problem)
    assert np.linalg.norm(stayed.theta) < 0.5
    found, _ = explore(optimizer, problem)
    np.testing.assert_allclose(found.theta, 1.5 * FAR, atol=0.3)


@pytest.mark.parametrize("module", [cma, cma_es, hybrid], ids=["cma", "cma_es", "hybrid"])
def test_what_explains_everything_is_not_doubted(module):
    optimizer = module.Settings().build(4, np.random.default_rng(3))
    assert explore(optimizer, NEAR)[1].evaluations <= follow(optimizer, NEAR)[1].evaluations + 40
