"""The kernels of a generation of CMA-ES do what their equations say."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from abs_service.tracker.optimizers.search.cma_update import (
    Constants,
    normal_quantiles,
    sample_population,
    update_distribution,
    update_factor,
)

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=25, deadline=None)


def drawn(seed: int, population: int, dimension: int) -> np.ndarray:
    """Normal numbers as `sample_population` draws them."""
    bits = np.random.default_rng(seed).bit_generator.random_raw((population * dimension + 3) // 4).view(np.uint16)
    z, thetas = np.zeros((population, dimension), np.float32), np.empty((population, dimension))
    sample_population(
        bits, normal_quantiles(), np.eye(dimension, dtype=np.float32), 1.0, np.zeros(dimension), z, thetas
    )
    return z[:population, :dimension]


def test_random_bits_become_normal_numbers():
    z = drawn(1, 20_000, 15).ravel().astype(np.float64)
    assert abs(z.mean()) < 4 / np.sqrt(z.size)
    assert abs(z.std() - 1) < 4 / np.sqrt(2 * z.size)
    assert abs(np.mean(z**4) - 3) < 4 * np.sqrt(96 / z.size)
    assert kstest(z, "norm").pvalue > 0.01
    assert 3.9 < np.abs(z).max() <= 4


@few
@given(seeds)
def test_candidates_are_the_mean_and_steps_along_the_axes(seed):
    generator = np.random.default_rng(seed)
    population, n = (int(size) for size in generator.integers(1, 20, 2))
    axes, mean, sigma = generator.normal(size=(n, n)).astype(np.float32), generator.normal(size=n), generator.random()
    bits = generator.integers(0, 2**16, population * n, dtype=np.uint16)
    rows, thetas = np.zeros((population, n), np.float32), np.empty((population, n))
    sample_population(bits, normal_quantiles(), axes, sigma, mean, rows, thetas)
    z = rows[:population, :n]
    place = (bits + 0.5) / 2**16 * (len(normal_quantiles()) - 1)
    expected = np.interp(place, np.arange(len(normal_quantiles())), normal_quantiles()).reshape(population, n)
    np.testing.assert_allclose(z, expected, atol=2e-6)
    np.testing.assert_allclose(thetas, mean + sigma * z.astype(np.float64) @ axes, atol=1e-5)


@few
@given(seeds)
def test_a_generation_teaches_what_the_tutorial_says(seed):
    """Figure 6 of Hansen's tutorial in plain NumPy, in the coordinates of the factor."""
    generator = np.random.default_rng(seed)
    population, n, g = int(generator.integers(4, 20)), int(generator.integers(2, 12)), int(generator.integers(1, 50))
    z, axes = (generator.normal(size=(rows, n)).astype(np.float32) for rows in (population, n))
    costs, mean, paths = generator.normal(size=population), generator.normal(size=n), generator.normal(size=(2, n))
    root = generator.normal(size=(n, n))
    learnt = (root @ root.T + np.eye(n)).astype(np.float32)
    constants = Constants(n, population)
    c_c, c_sigma, c_1, c_mu, d_sigma, mu_eff, expected_length = constants.rates
    ranked, w = z[np.argsort(costs)].astype(np.float64), constants.weights
    best = np.maximum(w, 0) @ ranked
    p_sigma = (1 - c_sigma) * paths[0] + np.sqrt(c_sigma * (2 - c_sigma) * mu_eff) * best
    length = np.linalg.norm(p_sigma) / expected_length
    h_sigma = length / np.sqrt(1 - (1 - c_sigma) ** (2 * g)) < 1.4 + 2 / (n + 1)
    p_c = (1 - c_c) * paths[1] + h_sigma * np.sqrt(c_c * (2 - c_c) * mu_eff) * best
    shares = np.where(w < 0, w * n / np.sum(ranked**2, axis=1), w)
    kept = 1 - c_1 - c_mu * w.sum() + (not h_sigma) * c_1 * c_c * (2 - c_c)
    wanted = kept * learnt + c_1 * np.outer(p_c, p_c) + c_mu * (ranked.T * shares) @ ranked
    mean_wanted = mean + 0.3 * best @ axes
    taught = learnt.copy()
    sigma = update_distribution(z, axes, np.argsort(costs), w, constants.rates, g, 0.3, mean, paths, taught)
    np.testing.assert_allclose(mean, mean_wanted, atol=1e-5)
    np.testing.assert_allclose(paths, [p_sigma, p_c], atol=1e-5)
    np.testing.assert_allclose(taught, wanted, atol=1e-4)
    assert np.isclose(sigma, 0.3 * np.exp(min(1.0, c_sigma / d_sigma * (length - 1))))


@few
@given(seeds)
def test_new_coordinates_describe_the_same_covariance_path_and_axes(seed):
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 12))
    metric, change = generator.normal(size=(2, n, n))
    factor = np.tril(generator.normal(size=(n, n))) + 2 * np.eye(n)
    learnt = np.eye(n) + 0.02 * change @ change.T
    path, axes = generator.normal(size=n), (metric @ factor).T.astype(np.float32)
    covariance, place = factor @ learnt @ factor.T, factor @ path
    rest = learnt.astype(np.float32)
    update_factor(rest, factor, path, axes)
    np.testing.assert_array_equal(rest, np.eye(n))
    np.testing.assert_allclose(factor @ factor.T, covariance, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(np.triu(factor, 1), 0, atol=1e-12)
    np.testing.assert_allclose(factor @ path, place, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(axes, (metric @ factor).T, rtol=1e-3, atol=1e-4)


def test_what_rounding_made_indefinite_keeps_the_deviations_of_the_axes():
    learnt = np.array([[4.0, 3.0], [3.0, 1.0]], np.float32)
    factor, path, axes = np.eye(2), np.ones(2), np.eye(2, dtype=np.float32)
    update_factor(learnt, factor, path, axes)
    np.testing.assert_allclose(factor, np.diag([2, 1]))
    np.testing.assert_allclose(path, [0.5, 1])
