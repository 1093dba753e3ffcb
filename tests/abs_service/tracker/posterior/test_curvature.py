"""The quadratic near one Θ: its coordinates, its minimum and its covariance."""

import numpy as np
import pytest

from abs_service.tracker.posterior.curvature import (
    Quadratic,
    gauss_newton,
    newton_step,
    posterior_covariance,
    search_metric,
)
from abs_service.tracker.terms.linearization import Linearization


@pytest.fixture
def problem() -> Linearization:
    generator = np.random.default_rng(4)
    jacobian = generator.normal(size=(60, 7)) @ np.diag(10.0 ** np.arange(-3, 4))
    return Linearization(generator.normal(size=60), jacobian)


@pytest.fixture
def quadratic(problem) -> Quadratic:
    return gauss_newton([problem], 7)


def test_the_quadratic_is_the_linearised_cost(problem, quadratic):
    step = np.random.default_rng(5).normal(size=7) * 10.0 ** -np.arange(-3, 4)
    cost = [0.5 * np.sum((problem.residual + problem.jacobian @ delta) ** 2) for delta in (0 * step, step)]
    promised = quadratic.gradient @ step + 0.5 * step @ quadratic.curvature @ step
    assert cost[1] - cost[0] == pytest.approx(promised, rel=1e-9)


def test_parts_of_a_cost_add(problem, quadratic):
    parts = [Linearization(problem.residual[rows], problem.jacobian[rows]) for rows in (slice(9), slice(9, 60))]
    added = gauss_newton(parts, 7)
    np.testing.assert_allclose(added.curvature, quadratic.curvature, rtol=1e-12)
    np.testing.assert_allclose(added.gradient, quadratic.gradient, rtol=1e-12)
    assert not gauss_newton([], 7).curvature.any()


def test_the_metric_makes_the_curvature_the_identity(quadratic):
    metric = search_metric(quadratic)
    np.testing.assert_allclose(metric.T @ quadratic.curvature @ metric, np.eye(7), atol=1e-8)


def test_the_newton_step_solves_a_linear_problem(problem, quadratic):
    step = newton_step(quadratic, search_metric(quadratic))
    expected = np.linalg.lstsq(problem.jacobian, -problem.residual, rcond=None)[0]
    np.testing.assert_allclose(step, expected, rtol=1e-6)


def test_the_covariance_is_that_of_the_estimates_of_a_linear_problem(quadratic, problem):
    """Θ estimated from many measurements with independent standard normal errors."""
    noise = np.random.default_rng(6).normal(size=(60, 20_000))
    scale = 10.0 ** np.arange(-3, 4)
    estimates = np.linalg.lstsq(problem.jacobian, noise, rcond=None)[0] * scale[:, None]
    covariance = posterior_covariance(quadratic) * np.outer(scale, scale)
    np.testing.assert_allclose(np.cov(estimates), covariance, atol=0.03 * np.abs(covariance).max())
