"""Directions that the measurements of a single frame do not show."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.posterior.covariance.observability import (
    KEPT_PRIOR,
    held_back,
    single_frame_deviation,
    unobserved_motion,
)
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction
from abs_service.tracker.posterior.priors.settings import Settings

#: Its widest form has the precision 1e4, itself it has none.
PREDICTION = MotionPrediction(
    np.zeros(2), np.inf, 1 / 30, False, ChangeMetric(np.ones(2), np.zeros((0, 2))), Settings(speed=0.3)
)


def optimum(curvature: np.ndarray) -> Optimum:
    """Optimum of points that only move along x and y with two parameters."""
    local = np.zeros((30, 3, 2))
    local[:, 0, 0] = local[:, 1, 1] = 1.0
    jacobian = SparseJacobian(local, np.zeros(30, np.int32), np.array([[0, 1]]), 2)
    linearized = LinearizedCost(np.zeros(2), Quadratic(np.zeros(2), curvature), np.zeros((2, 2)), [], jacobian)
    surface = Surface(*np.zeros((2, 1, 3, 30), np.float32))
    return Optimum(np.zeros(2), surface, linearized, [], np.zeros((2, 2)))


def test_a_direction_that_no_measurement_determines_is_found_in_a_single_frame():
    """The second parameter is measured, the first is not."""
    found = single_frame_deviation(optimum(np.diag([0.0, 1e6])), PREDICTION)
    assert found == pytest.approx(np.sqrt(1 / (KEPT_PRIOR * 1e4) + 1 / (1e6 + KEPT_PRIOR * 1e4)), rel=1e-6)
    measured = single_frame_deviation(optimum(1e6 * np.eye(2)), PREDICTION)
    assert measured == pytest.approx(np.sqrt(2e-6), rel=1e-3)


def test_only_a_motion_in_that_direction_remains_unobserved():
    found = unobserved_motion(4e-6 * np.eye(2), optimum(np.diag([0.0, 1e6])), PREDICTION)
    np.testing.assert_allclose(found, np.diag([4e-6, 0.0]), atol=1e-12)


def test_the_frame_s_own_motion_prior_counts_for_nothing():
    """Its part in the curvature makes room for a share of the widest one."""
    narrow = replace(PREDICTION, speed=0.1, metric=ChangeMetric(np.array([1.0, 0.5]), np.ones((1, 2))))
    np.testing.assert_allclose(
        narrow.exchanged(0.25), 0.25 * narrow.minimum_precision - narrow.precision, rtol=1e-12, atol=0
    )
    likelihood, wide = np.diag([1e3, 1e6]), replace(narrow, speed=np.inf)
    found = single_frame_deviation(optimum(likelihood + narrow.precision), narrow)
    assert found == pytest.approx(single_frame_deviation(optimum(likelihood), wide), rel=1e-9)


def test_a_lasting_lag_is_in_the_covariance_as_far_as_the_prior_causes_it():
    """The object is 10 mm farther than predicted along both axes; the second one is measured a hundred times better."""
    prior = replace(PREDICTION, speed=0.3)
    information, theta = np.diag([1.0, 100.0]) * prior.precision, np.array([0.01, 0.01])
    curvature = information + prior.precision
    estimate = np.linalg.solve(curvature, information @ theta)
    found = replace(optimum(curvature), theta=estimate, inverse_curvature=np.linalg.inv(curvature))
    held = held_back(found, prior)
    np.testing.assert_allclose(held, np.linalg.inv(curvature) @ prior.precision @ estimate, rtol=1e-12)
    np.testing.assert_allclose(held, -(estimate - theta) * np.diag(information) / np.diag(curvature), rtol=1e-9)
