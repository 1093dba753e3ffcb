"""Design effect of correlated residuals."""

import numpy as np
import pytest

from abs_service.tracker.posterior.covariance.design_effect import BEYOND, DesignEffects
from abs_service.tracker.posterior.covariance.sandwich import leverages
from abs_service.tracker.terms.linearization import Linearization
from tests.abs_service.tracker.scenes import flat, sheet

MESH = sheet(21, 31, flat)
DIM = 5


def effect(draw, frames: int = 60) -> float:
    """Design effect after some frames of residuals draw(generator), with smooth derivatives."""
    generator = np.random.default_rng(3)
    x, y = MESH.vertices[:, 0], MESH.vertices[:, 1]
    jacobian = np.stack([np.ones_like(x), x, y, x * y, x**2], axis=1)
    inverse = np.asarray(np.linalg.inv(jacobian.T @ jacobian + 1e-6 * np.eye(DIM)), np.float64)
    effects, found = DesignEffects(MESH), np.ones(1)
    for _ in range(frames):
        residual = draw(generator)
        sensed = [Linearization(residual, jacobian, places=MESH.vertices)]
        found = effects.update(inverse, sensed, leverages(inverse, sensed))
    return float(found[0])


def test_independent_residuals_have_an_effect_near_one():
    assert effect(lambda generator: generator.standard_normal(len(MESH.vertices))) < 1.6


def test_residuals_that_neighbours_share_have_the_effect_of_their_number():
    """Cells of the clusters' own size: 2.5 × 2.5 distances, so some six equal residuals each."""
    side = 2.5 * np.sqrt(MESH.area / len(MESH.vertices))
    cells = np.floor(MESH.vertices[:, :2] / side).astype(int)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    size = np.mean(np.bincount(cell.ravel())[cell.ravel()])
    found = effect(lambda generator: generator.standard_normal(cell.max() + 1)[cell.ravel()])
    assert found == pytest.approx(1 + BEYOND * (size - 1), rel=0.2)


def test_residuals_without_a_position_have_no_effect():
    effects = DesignEffects(MESH)
    sensed = [Linearization(np.ones(4), np.ones((4, 2))), Linearization(np.zeros(0), np.zeros((0, 2)))]
    found = effects.update(np.eye(2), sensed, leverages(np.eye(2), sensed))
    np.testing.assert_array_equal(found, [1, 1])
