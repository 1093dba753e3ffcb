"""Covariance of Θ over time, compared with the errors of the estimator that it describes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.posterior.covariance.error_propagation import ErrorPropagation, FrameErrors, Motion

DIM, FRAMES = 3, 40
SHARE = 0.25
NONE = np.zeros((DIM, DIM))
STILL = Motion(NONE, NONE, 0.0)
PRECISION = np.array([[4.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])


def setting() -> tuple[np.ndarray, np.ndarray]:
    """Curvature of the measurements, which see nothing of the last parameter, and Σ."""
    rows = np.random.default_rng(0).standard_normal((12, DIM)) * (3.0, 1.0, 0.0)
    measured = rows.T @ rows
    return measured, np.asarray(np.linalg.inv(measured + PRECISION))


def errors_of(inverse: np.ndarray, own: np.ndarray) -> FrameErrors:
    """Errors of a frame, of which a share lasts."""
    return FrameErrors(inverse, PRECISION, (1 - SHARE) * own, SHARE * own)


def test_it_is_the_covariance_of_the_errors_when_a_share_of_the_noise_is_that_of_the_first_frame():
    measured, inverse = setting()
    generator, step = np.random.default_rng(1), 0.3
    half, errors = np.linalg.cholesky(measured + 1e-12 * np.eye(DIM)), []
    for _ in range(4000):
        lasting, error = np.sqrt(SHARE) * half @ generator.standard_normal(DIM), np.zeros(DIM)
        for frame in range(FRAMES):
            moved = step * generator.standard_normal(DIM) if frame else np.zeros(DIM)
            score = lasting + np.sqrt(1 - SHARE) * half @ generator.standard_normal(DIM)
            error = inverse @ (PRECISION @ (error + moved) + score)
        errors.append(error)
    propagation, found = ErrorPropagation(NONE), np.eye(DIM)
    for _ in range(FRAMES):
        found = propagation.update(Motion(step**2 * np.eye(DIM), NONE, 0.0), errors_of(inverse, measured))
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    np.testing.assert_allclose(np.cov(np.transpose(errors)) / scale, found / scale, atol=0.08)


def test_what_nothing_holds_grows_with_every_frame_and_what_is_measured_does_not():
    measured, inverse = setting()
    propagation, moved = ErrorPropagation(NONE), np.diag([0.1, 0.1, 0.2]) ** 2
    motion, errors = Motion(NONE, moved, 0.0), errors_of(inverse, measured)
    found = [np.diag(propagation.update(motion, errors)) for _ in range(FRAMES)]
    assert found[0][2] == pytest.approx(0, abs=1e-12)  # the first frame defines where the points are
    np.testing.assert_allclose(np.diff([variance[2] for variance in found]), 0.2**2, rtol=1e-6)
    assert found[-1][0] < 1.5 * found[5][0]


def test_a_motion_that_nothing_shows_goes_on_as_it_began():
    """Errors of an object whose velocity lasts: far larger than those of a random walk of the same size."""
    persistence, step, frames, generator, ends = 0.7, 0.3, 20, np.random.default_rng(2), []
    for _ in range(4000):
        error, motion = np.zeros(DIM), step * generator.standard_normal(DIM)
        for _ in range(frames):
            error = error + motion
            motion = persistence * motion + np.sqrt(1 - persistence**2) * step * generator.standard_normal(DIM)
        ends.append(error)
    propagation, found = ErrorPropagation(NONE), NONE
    unmeasured = np.asarray(np.linalg.inv(PRECISION))  # with it, the gain is one
    for _ in range(frames + 1):
        found = propagation.update(Motion(NONE, step**2 * np.eye(DIM), persistence), errors_of(unmeasured, NONE))
    np.testing.assert_allclose(np.diag(found), np.var(ends, axis=0), rtol=0.08)
    assert found[0, 0] > 4 * frames * step**2


def test_a_template_begins_with_the_error_of_its_place():
    _, inverse = setting()
    found = ErrorPropagation(4 * np.eye(DIM)).update(STILL, errors_of(inverse, NONE))
    assert found[2, 2] == pytest.approx(4)  # nothing measures it
    assert found[0, 0] < 0.5


def test_after_a_relocation_it_begins_with_what_that_leaves_open():
    _, inverse = setting()
    propagation = ErrorPropagation(NONE)
    propagation.update(STILL, errors_of(inverse, NONE))
    propagation.restart(25 * np.eye(DIM))
    found = propagation.update(STILL, errors_of(inverse, NONE))
    assert found[2, 2] == pytest.approx(25)


@given(st.integers(0, 2**32 - 1))
def test_it_is_the_recursion_of_the_module(seed):
    """E, V, C and R in plain NumPy, as the module's docstring has them, over some frames."""
    generator = np.random.default_rng(seed)
    error, velocity, cross, response, propagation = NONE, NONE, NONE, NONE, ErrorPropagation(NONE)
    for frame in range(4):
        rows = generator.normal(size=(5, 7, DIM))
        q, u, w, b, lasting = (part.T @ part for part in rows)
        inverse, rho = np.linalg.inv(b + w), generator.random()
        found = propagation.update(Motion(q, u, rho), FrameErrors(inverse, w, b, lasting))
        gain = inverse @ w
        if frame:
            velocity = rho**2 * velocity + ((1 - rho**2) if velocity.any() else 1.0) * u
            error, cross = error + rho * (cross + cross.T) + velocity + q, rho * cross + velocity
        error = gain @ error @ gain.T + inverse @ b @ inverse
        cross, response = gain @ cross, gain @ response + inverse
        expected = error + response @ lasting @ response.T
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
