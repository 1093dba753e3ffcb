"""CMA-ES finds minima, the same ones each time, and starts every frame with what the last one taught."""

import numpy as np
import pytest

from abs_service.tracker.optimizers.cma import Cma, Settings


def search(seed: int = 1, dimension: int = 6, **settings) -> Cma:
    return Settings(**settings).build(dimension, np.random.default_rng(seed))


def minimize(optimizer: Cma, cost, generations: int) -> list[np.ndarray]:
    means = []
    for _ in range(generations):
        candidates = optimizer.ask()
        optimizer.tell(candidates, cost(candidates))
        means.append(optimizer.mean)
    return means


TARGET = np.array([1.0, -0.5, 0.3, 2.0, 0.0, -1.0])
AXES = 10.0 ** np.linspace(-1, 1, 6)


def sphere(x):
    return np.sum((x - TARGET) ** 2, axis=1)


def ellipsoid(x):
    return np.sum((AXES * (x - TARGET)) ** 2, axis=1)


@pytest.mark.parametrize("cost", [sphere, ellipsoid])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_minimum_is_found(cost, seed):
    found = minimize(search(seed), cost, 250)[-1]
    np.testing.assert_allclose(found, TARGET, atol=1e-4)


def test_equal_seeds_search_alike_to_the_last_bit():
    a, b, c = (minimize(search(seed), ellipsoid, 40) for seed in (5, 5, 6))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def shared_state() -> list[int]:
    state = np.random.get_state(legacy=False)["state"]
    return [*state["key"].tolist(), state["pos"]]


def test_random_numbers_come_from_its_own_generator_only():
    before = shared_state()
    optimizer = search()
    minimize(optimizer, sphere, 10)
    optimizer.restart()
    minimize(optimizer, sphere, 10)
    assert shared_state() == before


def test_population_and_generations_are_as_asked():
    assert search(population=17).ask().shape == (17, 6)
    assert search().ask().shape == (9, 6)  # 4 + 3 ln 6
    assert search(generations=7).generations == 7


def test_the_first_candidates_deviate_by_the_step():
    candidates = search(step=0.4, population=2000).ask()
    assert candidates.std() == pytest.approx(0.4, rel=0.03)
    assert abs(candidates.mean()) < 0.02


def spread(optimizer: Cma) -> np.ndarray:
    """Deviations of the candidates along the axes, in units of the step."""
    return np.std([row for _ in range(400) for row in optimizer.ask()], axis=0) / optimizer.deviation


def test_a_new_frame_begins_at_the_prediction_with_the_old_covariance():
    optimizer = search()
    minimize(optimizer, ellipsoid, 120)
    learnt = spread(optimizer)
    assert learnt[0] / learnt[-1] > 10  # the ellipsoid's axes differ by a factor of 100
    optimizer.restart()
    np.testing.assert_array_equal(optimizer.mean, np.zeros(6))
    np.testing.assert_allclose(spread(optimizer), learnt, rtol=0.15)


def test_the_step_of_a_new_frame_is_bounded():
    optimizer = search(step=1.0, least_step=0.5)
    minimize(optimizer, sphere, 60)
    assert optimizer.deviation < 0.1
    optimizer.restart()
    assert optimizer.deviation == 0.5
    minimize(optimizer, lambda x: -np.sum(x, axis=1), 30)  # a slope without an end makes it grow
    assert optimizer.deviation > 1
    optimizer.restart()
    assert optimizer.deviation == 1.0


def test_many_frames_do_not_wear_it_out():
    """300 frames of 5 generations; pycma's own conditions to stop must not matter."""
    optimizer = search(2, 12)
    generator = np.random.default_rng(0)
    for _ in range(300):
        optimizer.restart()
        target = generator.normal(0, 0.3, 12)
        minimize(optimizer, lambda x, target=target: np.sum((x - target) ** 2, axis=1), 5)
    assert np.isfinite(optimizer.mean).all()
    deviations = spread(optimizer)
    assert deviations.min() > 0.01
    assert deviations.max() < 100


def test_equal_costs_are_survived():
    optimizer = search()
    minimize(optimizer, lambda x: np.zeros(len(x)), 20)
    assert np.isfinite(optimizer.mean).all()
