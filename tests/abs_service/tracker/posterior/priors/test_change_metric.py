"""Lengths of changes of Θ: those of the definition, and longer for what is not smooth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.nurbs import second_differences
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.integers(0, 6))
def test_lengths_are_those_of_the_definition(seed, rows):
    generator = np.random.default_rng(seed)
    scales, thetas, center = generator.uniform(0.5, 2, 5), generator.normal(size=(4, 5)), generator.normal(size=5)
    roughness = generator.normal(size=(rows, 5)) * (generator.random((rows, 5)) < 0.5)
    metric = ChangeMetric(scales, roughness)
    changes = thetas - center
    expected = np.sum((changes / scales) ** 2, axis=1) + np.sum((changes @ roughness.T) ** 2, axis=1)
    np.testing.assert_allclose(metric.squares(thetas, center), expected)
    np.testing.assert_allclose(np.sum((changes @ metric.root.T) ** 2, axis=1), expected)
    np.testing.assert_allclose(np.einsum("ki,ij,kj->k", changes, metric.matrix, changes), expected)
    np.testing.assert_allclose(metric.inverse @ metric.matrix, np.eye(5), atol=1e-9)


@given(SEEDS, st.integers(3, 6), st.integers(3, 6))
def test_a_grid_that_is_moved_turned_or_stretched_is_smooth_and_a_bent_one_is_not(seed, rows, columns):
    generator = np.random.default_rng(seed)
    row, column = np.indices((rows, columns)).reshape(2, -1)
    differences = second_differences(rows, columns)
    shift, along, across = generator.normal(size=3)
    np.testing.assert_allclose(differences @ (shift + along * row + across * column), 0, atol=1e-12)
    # xx, yy and twice xy of a² + 3 a b: 2 in every column, nothing, and √2 · 3 in every cell
    energy = np.sum((differences @ (row**2 + 3 * row * column)) ** 2)
    assert energy == pytest.approx(4 * (rows - 2) * columns + 18 * (rows - 1) * (columns - 1))
