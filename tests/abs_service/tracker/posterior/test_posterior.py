"""Linearisations of the cost of one frame."""

import numpy as np

from abs_service.tracker.posterior.curvature import search_metric
from abs_service.tracker.posterior.posterior import REUSED_WITHIN
from abs_service.tracker.terms.linearization import stack
from abs_service.tracking.observer import Observer
from tests.abs_service.tracking.driving import frame_set, posterior_of
from tests.abs_service.tracking.test_session import RIG, SHEET, drive, tracking


def test_a_linearisation_is_moved_to_a_near_theta_and_made_anew_for_a_far_one():
    *_, step = drive(one := tracking(vertices=120), SHEET, [0, 1])
    assert one.model is not None
    theta, exposed = step.estimate.theta, SHEET.expose(1)[0]
    frame = posterior_of(one.model, RIG, exposed).observe(Observer(RIG).observe(frame_set(exposed, 1)))
    at = frame.linearize(theta)
    metric = search_metric(at)
    direction = metric @ np.ones(len(theta)) / np.sqrt(len(theta))  # one standard deviation
    small, large = (size * direction * np.sqrt(2 * REUSED_WITHIN * len(theta)) for size in (0.99, 1.01))
    near = frame.linearized_near(theta + small)
    assert near.quadratic is at
    sources = frame.linearized_near(theta).sensed, near.sensed
    before, after = (stack([part for parts in source for part in parts], len(theta)) for source in sources)
    np.testing.assert_array_equal(after.jacobian, before.jacobian)
    np.testing.assert_allclose(after.residual, before.residual + before.jacobian @ small, atol=1e-9)
    far = frame.linearized_near(theta + large)
    assert far.quadratic is not at
    np.testing.assert_array_equal(far.theta, theta + large)
