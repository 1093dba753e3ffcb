"""What the cost near a Θ is good for beside it."""

import numpy as np

from abs_service.tracker.posterior.curvature import search_metric
from abs_service.tracker.posterior.posterior import NEAR
from abs_service.tracker.terms.linearization import stack
from tests.tracker.test_tracking import SHEET, drive, tracking


def test_near_the_last_linearisation_its_residuals_move_along_and_farther_off_a_new_one_is_made():
    *_, step = drive(one := tracking(vertices=120), SHEET, [0, 1])
    assert one._tracker is not None
    posterior, theta = one._tracker._posterior, step.estimate.theta
    at = posterior.linearize(theta)
    metric = search_metric(at)
    direction = metric @ np.ones(len(theta)) / np.sqrt(len(theta))  # one deviation
    small, large = (size * direction * np.sqrt(2 * NEAR * len(theta)) for size in (0.99, 1.01))
    same = posterior.linearized_near(theta + small)
    assert same.quadratic is at
    before, after = (stack(parts, len(theta)) for parts in (posterior.linearized_near(theta).sensed, same.sensed))
    np.testing.assert_array_equal(after.jacobian, before.jacobian)
    np.testing.assert_allclose(after.residual, before.residual + before.jacobian @ small, atol=1e-9)
    other = posterior.linearized_near(theta + large)
    np.testing.assert_array_equal(other.theta, theta + large)
    assert posterior.linearize(theta + large) is other.quadratic
