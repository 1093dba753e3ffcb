"""Covariance of Θ from the residuals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.posterior.covariance.sandwich import gradient_covariance, leverages, variances
from abs_service.tracker.terms.linearization import Linearization

SEEDS = st.integers(0, 2**32 - 1)


def sandwich(inverse: np.ndarray, residual: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Covariance of the solutions, of independent residuals."""
    curvature, sensed = np.asarray(np.linalg.inv(inverse), np.float64), [Linearization(residual, rows)]
    variance = variances(sensed, leverages(inverse, sensed), np.ones(1))
    return inverse @ gradient_covariance(curvature - rows.T @ rows, sensed, variance, np.ones(1)) @ inverse


@given(SEEDS)
def test_the_sandwich_is_that_of_the_definition(seed):
    generator = np.random.default_rng(seed)
    rows, residual, half = (generator.standard_normal(shape) for shape in ((12, 4), 12, (4, 4)))
    prior = half @ half.T + 0.1 * np.eye(4)
    inverse = np.asarray(np.linalg.inv(rows.T @ rows + prior), np.float64)
    leverage = np.diag(rows @ inverse @ rows.T)
    expected = inverse @ (rows.T @ np.diag(residual**2 / (1 - leverage)) @ rows + prior) @ inverse
    found = sandwich(inverse, residual, rows)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
    assert np.linalg.eigvalsh(found).min() > 0


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_the_sandwich_learns_the_noise_that_the_residuals_show(factor):
    """Noise of another deviation than the model's: the covariance is that of the solutions all the same."""
    generator = np.random.default_rng(5)
    rows = generator.standard_normal((200, 4))
    inverse = np.asarray(np.linalg.inv(rows.T @ rows), np.float64)
    fit = np.eye(200) - rows @ inverse @ rows.T
    draws = [fit @ (factor * generator.standard_normal(200)) for _ in range(100)]
    mean = np.mean([sandwich(inverse, residual, rows) for residual in draws], axis=0)
    np.testing.assert_allclose(mean, factor**2 * inverse, atol=0.05 * factor**2 * np.diag(inverse).max())
