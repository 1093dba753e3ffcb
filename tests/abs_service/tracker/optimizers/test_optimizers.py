"""Strategies find minima, the same ones each time, and start every frame with what the last one taught."""

import numpy as np
import pytest

from abs_service.tracker.optimizers.base import Outcome, RunningSearch, Search, Stop
from abs_service.tracker.optimizers.cma import PycmaSampler
from abs_service.tracker.optimizers.cma_es import FORGOTTEN, CmaEsSampler
from abs_service.tracker.optimizers.search.ask_and_tell import Sampler, default_population


@pytest.fixture(params=[PycmaSampler, CmaEsSampler], ids=["cma", "cma_es"])
def make(request):
    """A strategy from seed, dimension, least step, population and step."""

    def strategy(seed: int = 1, dimension: int = 6, minimum: float = 0.5, population: int = 0, step: float = 1.0):
        population = population or default_population(dimension)
        return request.param(dimension, np.random.default_rng(seed), minimum, population, step)

    return strategy


def begin(strategy: Sampler) -> None:
    """A frame in which Θ is ξ."""
    dimension = len(strategy.mean)
    strategy.restart(np.zeros(dimension), np.eye(dimension))


def minimize(strategy: Sampler, cost, generations: int) -> list[np.ndarray]:
    means = []
    for _ in range(generations):
        strategy.tell(cost(strategy.ask()))
        means.append(strategy.mean)
    return means


TARGET = np.array([1.0, -0.5, 0.3, 2.0, 0.0, -1.0])
AXES = 10.0 ** np.linspace(-1, 1, 6)


def sphere(x):
    return np.sum((x - TARGET) ** 2, axis=1)


def ellipsoid(x):
    return np.sum((AXES * (x - TARGET)) ** 2, axis=1)


@pytest.mark.parametrize("cost", [sphere, ellipsoid])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_minimum_is_found(make, cost, seed):
    found = minimize(make(seed), cost, 250)[-1]
    np.testing.assert_allclose(found, TARGET, atol=1e-4)


def test_equal_seeds_search_alike_to_the_last_bit(make):
    a, b, c = (minimize(make(seed), ellipsoid, 40) for seed in (5, 5, 6))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def shared_state() -> list[int]:
    state = np.random.get_state(legacy=False)["state"]
    return [*state["key"].tolist(), state["pos"]]


def test_random_numbers_come_from_its_own_generator_only(make):
    before = shared_state()
    strategy = make()
    minimize(strategy, sphere, 10)
    begin(strategy)
    minimize(strategy, sphere, 10)
    assert shared_state() == before


def test_the_first_candidates_deviate_by_the_step(make):
    candidates = make(step=0.4, population=2000).ask()
    assert candidates.std() == pytest.approx(0.4, rel=0.03)
    assert abs(candidates.mean()) < 0.02


def spread(strategy: Sampler) -> np.ndarray:
    """Deviations of the candidates along the axes, in units of the step."""
    return np.std([row for _ in range(400) for row in strategy.ask()], axis=0) / strategy.deviation


def test_a_new_frame_begins_at_the_prediction_with_what_is_kept_of_the_covariance(make):
    """All of it by pycma, the reference; half of it by the search for live use, and the identity for the rest."""
    strategy = make()
    minimize(strategy, ellipsoid, 120)
    learnt = spread(strategy)
    assert learnt[0] / learnt[-1] > 10  # the ellipsoid's axes differ by a factor of 100
    strategy.restart(TARGET, np.eye(6))
    np.testing.assert_array_equal(strategy.mean, TARGET)
    forgotten = FORGOTTEN if isinstance(strategy, CmaEsSampler) else 0.0
    np.testing.assert_allclose(spread(strategy), np.sqrt((1 - forgotten) * learnt**2 + forgotten), rtol=0.15)


def test_long_searches_leave_the_next_frame_free_to_move():
    """The cost of a frame is rough: what a long search learns of that must not keep the next one where it is."""
    strategy = CmaEsSampler(12, np.random.default_rng(1), 0.5, 16, 1.0)
    for seed in range(10):
        begin(strategy)
        rough = np.random.default_rng(seed).normal(0, 3, 12)
        minimize(strategy, lambda x, rough=rough: np.sum(x**2, axis=1) + np.cos(40 * x) @ rough, 300)
    begin(strategy)
    assert spread(strategy).min() > np.sqrt(FORGOTTEN) * 0.95


def test_the_step_of_a_new_frame_is_bounded(make):
    strategy = make(step=1.0, minimum=0.5)
    minimize(strategy, sphere, 60)
    assert strategy.deviation < 0.1
    begin(strategy)
    assert strategy.deviation == 0.5
    minimize(strategy, lambda x: -np.sum(x, axis=1), 30)  # a slope without an end makes it grow
    assert strategy.deviation > 1
    begin(strategy)
    assert strategy.deviation == 1.0


def test_many_frames_do_not_wear_it_out(make):
    """300 frames of 5 generations; pycma's own conditions to stop must not matter."""
    strategy = make(2, 12)
    generator = np.random.default_rng(0)
    for _ in range(300):
        begin(strategy)
        target = generator.normal(0, 0.3, 12)
        minimize(strategy, lambda x, target=target: np.sum((x - target) ** 2, axis=1), 5)
    assert np.isfinite(strategy.mean).all()
    deviations = spread(strategy)
    assert deviations.min() > 0.01
    assert deviations.max() < 100


def test_equal_costs_are_survived(make):
    strategy = make()
    minimize(strategy, lambda x: np.zeros(len(x)), 20)
    assert np.isfinite(strategy.mean).all()


def test_a_running_search_asks_until_it_has_an_outcome():
    def search() -> Search:
        first = yield np.zeros((2, 1))
        second = yield np.ones((3, 1))
        return Outcome(np.array([first.sum() + second.sum()]), 0.0, "two", Stop.CONVERGED, 0.0)

    running = RunningSearch(search())
    asked: list[int] = []
    while running.outcome is None:
        thetas = running.ask()
        asked.append(len(thetas))
        running.tell(thetas[:, 0])
    assert asked == [2, 3]
    assert running.outcome.theta == [3.0]
