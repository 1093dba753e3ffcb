"""Linearisations of the cost of one frame."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.posterior.curvature import search_metric
from abs_service.tracker.posterior.linearized_cost import NEAR
from abs_service.tracker.terms.linearization import stack
from abs_service.tracking.observer import Observer
from tests.abs_service.tracking.driving import frame_posterior_of, frame_set, posterior_of
from tests.abs_service.tracking.test_session import RIG, SHEET, drive, tracking


def test_a_linearisation_serves_a_near_optimum_and_is_made_anew_for_a_far_one():
    *_, step = drive(one := tracking(vertices=120), SHEET, [0, 1])
    assert one.model is not None
    theta, exposed = step.estimate.theta, SHEET.expose(1)[0]
    frame = frame_posterior_of(one.model, RIG, exposed, exposed)
    at = frame.linearize(theta)
    direction = search_metric(at.quadratic) @ np.ones(len(theta)) / np.sqrt(len(theta))  # one standard deviation
    small, large = (size * direction * np.sqrt(2 * NEAR * len(theta)) for size in (0.99, 1.01))
    assert frame.optimum(theta + small, at).linearized is at
    np.testing.assert_array_equal(frame.optimum(theta + large, at).linearized.theta, theta + large)
    sources = at.sensed, at.sensed_at(theta + small)
    before, after = (stack(source, len(theta)) for source in sources)
    np.testing.assert_array_equal(after.jacobian, before.jacobian)
    np.testing.assert_allclose(after.residual, before.residual + before.jacobian @ small, atol=1e-9)


def test_the_order_in_which_a_frame_is_asked_changes_nothing():
    *_, step = drive(one := tracking(vertices=120), SHEET, [0, 1])
    assert one.model is not None
    theta, exposed = step.estimate.theta, SHEET.expose(1)[0]
    frame = frame_posterior_of(one.model, RIG, exposed, exposed)
    first = frame.optimum(theta, None)
    fits = frame.fits(theta)
    frame.linearize(theta + 1e-4)
    frame.fits(theta + 1e-4)
    frame.cost(theta[None] + 1e-3, one.model.deform(theta[None] + 1e-3))
    again = frame.optimum(theta, None)
    np.testing.assert_array_equal(again.inverse_curvature, first.inverse_curvature)
    assert frame.fits(theta) == fits


def test_the_motion_prior_adds_its_own_gradient_and_precision_to_the_other_priors():
    *_, step = drive(one := tracking(vertices=120), SHEET, [0, 1])
    assert one.model is not None
    theta, exposed = step.estimate.theta, SHEET.expose(1)[0]
    frame = frame_posterior_of(one.model, RIG, exposed, exposed)
    motion, narrow = frame.motion, frame.with_motion(replace(frame.motion, speed=frame.motion.speed / 2))
    rows = motion.metric.root / (motion.speed * motion.elapsed_s)  # of residuals whose half squares are the cost
    residual = rows @ (theta - motion.theta)
    assert motion.cost(theta[None])[0] == pytest.approx(residual @ residual / 2, rel=1e-9)
    wide, added = frame.prior(theta), narrow.prior(theta)  # four times the precision: three times it is added
    np.testing.assert_allclose(added.curvature - wide.curvature, 3 * rows.T @ rows, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(added.gradient - wide.gradient, 3 * rows.T @ residual, rtol=1e-6, atol=1e-6)


def test_the_posterior_of_a_frame_answers_no_more_once_the_next_is_observed():
    *_, step = drive(one := tracking(vertices=120), SHEET, [0, 1])
    assert one.model is not None
    theta, exposed = step.estimate.theta, SHEET.expose(1)[0]
    posterior = posterior_of(one.model, RIG, exposed)
    observation = Observer(RIG).observe(frame_set(exposed, 1))
    prediction = posterior.motion.predict(observation.t_host_ns)
    first, second = posterior.observe(observation, prediction), posterior.observe(observation, prediction)
    assert len(second.fits(theta)) == 2
    with pytest.raises(RuntimeError, match="after the next frame"):
        first.fits(theta)
