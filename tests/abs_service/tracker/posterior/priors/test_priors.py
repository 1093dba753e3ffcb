"""Predictions and costs of the priors."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prediction import MARGIN, MotionPrediction
from abs_service.tracker.posterior.priors.motion_prior import (
    FIRST_INTERVAL_S,
    LAG_MARGIN,
    MAX_INTERVAL_S,
    MotionPrior,
    RecentMotion,
)
from abs_service.tracker.posterior.priors.settings import Settings
from abs_service.tracker.posterior.priors.shape_prior import ShapePrior
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.linearization import stack
from tests.abs_service.tracker.scenes import as_surface, flat, sheet

MS = 1_000_000
KNOWN = np.zeros((2, 2))

#: Roughness of a model of two parameters whose changes are all smooth.
SMOOTH = np.zeros((0, 2))


def prior(speed: float = 0.3, memory_s: float = 1e9) -> MotionPrior:
    return MotionPrior(
        np.zeros(2), ChangeMetric(np.array([1.0, 2.0]), SMOOTH), Settings(speed=speed, memory_s=memory_s)
    )


def test_before_any_motion_it_expects_none():
    motion = prior()
    np.testing.assert_array_equal(motion.predict(123 * MS).theta, [0, 0])


def test_a_constant_velocity_goes_on():
    motion = prior()
    for k in range(5):
        prediction = motion.predict(k * 40 * MS)
        if k > 1:
            np.testing.assert_allclose(prediction.theta, [0.01 * k, -0.02 * k], atol=1e-12)
        motion.update(prediction, np.array([0.01, -0.02]) * k, KNOWN)


def test_after_a_gap_the_velocity_still_is_per_second():
    motion = prior()
    for t_ms, x in [(0, 0.0), (50, 0.05), (150, 0.15)]:  # 1 m/s
        motion.update(motion.predict(t_ms * MS), np.array([x, 0]), KNOWN)
    np.testing.assert_allclose(motion.predict(350 * MS).theta, [0.35, 0], atol=1e-12)


def test_motion_fades_with_the_age_of_the_last_estimate():
    travelled = []
    for gap_ms in (10, 100, 400, 5000):
        motion = prior(memory_s=0.1)
        for t_ms, x in [(0, 0.0), (50, 0.05)]:
            motion.update(motion.predict(t_ms * MS), np.array([x, 0]), KNOWN)
        travelled.append(motion.predict((50 + gap_ms) * MS).theta[0] - 0.05)
    expected = [gap * np.exp(-gap / 0.1) for gap in (0.01, 0.1, 0.4, MAX_INTERVAL_S)]
    np.testing.assert_allclose(travelled, expected, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_stretch_rows_are_the_derivatives_of_the_edges_lengths(seed):
    generator = np.random.default_rng(seed)
    mesh, group = sheet(4, 5), np.sort(generator.integers(0, 3, 20)).astype(np.int32)
    parameters = np.stack([generator.permutation(7)[:4] for _ in range(3)])
    sparse_jacobian = SparseJacobian(generator.standard_normal((20, 3, 4)), group, parameters, 7)
    moved = mesh.vertices + generator.normal(0, 5e-3, mesh.vertices.shape)
    surface = as_surface((moved, mesh.normals))
    linear = stack(StretchPrior(mesh, 0.02).linearize(surface, sparse_jacobian), 7)
    (i, j), now = mesh.edges.T, surface.vertices[0].T.astype(float)
    rest = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    length = np.linalg.norm(now[i] - now[j], axis=1)
    jacobian = np.einsum(
        "ei,eid->ed", (now[i] - now[j]) / length[:, None], sparse_jacobian.dense[i] - sparse_jacobian.dense[j]
    )
    order = np.argsort(np.where(group[i] == group[j], group[i], 3), kind="stable")
    np.testing.assert_allclose(linear.residual, ((length / rest - 1) / 0.02)[order], rtol=0, atol=1e-4)
    np.testing.assert_allclose(linear.jacobian, (jacobian / rest[:, None] / 0.02)[order], rtol=1e-5, atol=1e-2)


def test_the_cost_is_that_of_a_speed():
    """A deviation of 0.3 m/s of the surface from the prediction costs ½, for every parameter."""
    motion = prior()
    motion.update(motion.predict(0), np.zeros(2), KNOWN)
    prediction = motion.predict(100 * MS)
    off = np.array([[0.03, 0.0], [0.0, 0.06], [0.0, 0.0]])
    np.testing.assert_allclose(prediction.cost(off), [0.5, 0.5, 0])


@pytest.mark.parametrize(("gap_ms", "seconds"), [(20, 0.02), (10_000, MAX_INTERVAL_S)])
def test_the_longer_the_gap_the_less_is_known_up_to_a_bound(gap_ms, seconds):
    motion = prior()
    motion.update(motion.predict(0), np.zeros(2), KNOWN)
    prediction = motion.predict(gap_ms * MS)
    assert prediction.cost(np.array([[0.3 * seconds, 0]]))[0] == pytest.approx(0.5)


def test_the_first_frame_is_given_the_usual_interval():
    motion = prior()
    prediction = motion.predict(77)
    assert prediction.cost(np.array([[0.3 * FIRST_INTERVAL_S, 0]]))[0] == pytest.approx(0.5)


@pytest.mark.parametrize("again_ns", [0, -5])
def test_time_that_stands_still_or_goes_back_is_survived(again_ns):
    motion = prior()
    motion.update(motion.predict(0), np.ones(2), KNOWN)
    prediction = motion.predict(again_ns)
    assert np.isfinite(prediction.cost(np.ones((1, 2)))).all()


def test_what_a_model_knows_is_normal_around_its_rest():
    shape = ShapePrior(np.array([1.0, 2.0, 3.0]), np.array([[2.0, 0, 0], [0, 1, -1]]))
    thetas = np.array([[1.0, 2, 3], [2, 2, 3], [1, 5, 3], [1, 5, 6]])
    np.testing.assert_allclose(shape.cost(thetas), [0, 2, 4.5, 0])
    linear = shape.linearize(thetas[1])
    for step in np.eye(3):
        moved = shape.cost((thetas[1] + step)[None])[0]
        assert moved == pytest.approx(0.5 * np.sum((linear.residual + linear.jacobian @ step) ** 2))


def test_who_knows_nothing_pays_nothing():
    shape = ShapePrior(np.zeros(2), np.zeros((0, 2)))
    np.testing.assert_array_equal(shape.cost(np.ones((3, 2))), 0)
    assert shape.linearize(np.ones(2)).jacobian.shape == (0, 2)


MESH = sheet(height=flat)


def bent(radius: float) -> np.ndarray:
    """The flat mesh rolled onto a cylinder, which stretches nothing but chords."""
    x, y, _ = MESH.vertices.T
    return np.stack([radius * np.sin(x / radius), y, 1 + radius * (1 - np.cos(x / radius))], axis=1)


def test_bending_costs_next_to_nothing_and_stretching_does():
    costs = StretchPrior(MESH, 0.01).cost(
        as_surface(*((v, MESH.normals) for v in (MESH.vertices, bent(0.15), MESH.vertices * (1.02, 1, 1))))
    )
    assert costs[0] == pytest.approx(0, abs=1e-6)
    assert costs[1] < 0.02 * costs[2]
    along_x = np.count_nonzero(MESH.edges[:, 1] - MESH.edges[:, 0] == 1)
    assert costs[2] > along_x * 0.5 * 2.0**2 * 0.99


def test_lengths_at_rest_may_change():
    longer, surface = MESH.vertices * (1.02, 1, 1), as_surface((bent(0.15), MESH.normals))
    changed, jacobian = StretchPrior(MESH, 0.01), SparseJacobian.from_dense(np.ones((len(MESH.vertices), 3, 2)))
    changed.rest_on(longer)
    new = StretchPrior(replace(MESH, vertices=longer), 0.01)
    np.testing.assert_array_equal(changed.cost(surface), new.cost(surface))
    one, other = (stack(prior.linearize(surface, jacobian), 2) for prior in (changed, new))
    np.testing.assert_array_equal(one.residual, other.residual)


def test_a_mesh_has_every_edge_once():
    rows, columns = 9, 13
    assert len(MESH.edges) == rows * (columns - 1) + columns * (rows - 1) + (rows - 1) * (columns - 1)


class Followed(NamedTuple):
    """The prior of the next frame after an estimate, and what that told of the motion."""

    next: MotionPrediction
    recent: RecentMotion


def follow(motion: MotionPrior, steps: list[float], held: float = 1.0, begin: int = 0) -> list[Followed]:
    """Frames after estimates that are off the prediction by so much [m], at 30 Hz; so much of them is measured."""
    frames = []
    prediction = motion.predict(round(begin * 1e9 / 30))
    for k, step in enumerate([0.0, *steps], start=begin + 1):
        known = np.asarray((1 - held) * np.linalg.inv(prediction.precision), np.float64)
        recent = motion.update(prediction, prediction.theta + np.array([step, 0.0]), known)
        prediction = motion.predict(round(k * 1e9 / 30))
        frames.append(Followed(prediction, recent))
    return frames[1:]


def test_a_calm_object_narrows_the_prior_to_its_bound_at_once():
    assert [one.next.speed for one in follow(prior(), [1e-6] * 3)] == [Settings().minimum_speed] * 3


def test_the_prior_follows_the_size_of_erratic_innovations():
    steps = [(-1) ** k * 1e-3 for k in range(60)]  # successive ones have nothing in common
    assert follow(prior(), steps)[-1].next.speed == pytest.approx(MARGIN * 1e-3 * 30 / np.sqrt(2), rel=1e-6)


def test_innovations_in_a_row_widen_the_prior_far_more():
    assert follow(prior(), [1e-3] * 60)[-1].next.speed == pytest.approx(LAG_MARGIN * 1e-3 * 30 / np.sqrt(2), rel=0.05)


def test_without_measurements_the_motion_is_that_of_before():
    motion = prior()
    before = follow(motion, [1e-3] * 30)[-1].recent
    after = follow(motion, [0.0] * 30, held=0.0, begin=32)[-1].recent
    np.testing.assert_allclose(after.unmeasured, before.unmeasured, rtol=0.1)
    np.testing.assert_allclose(after.unpredicted, before.unpredicted, rtol=0.1)


def test_equal_bounds_fix_the_prior():
    motion = MotionPrior(np.zeros(2), ChangeMetric(np.ones(2), SMOOTH), Settings(speed=0.1, minimum_speed=0.1))
    assert {one.next.speed for one in follow(motion, [1e-6, 1e-3, 0.1])} == {0.1}


def test_after_a_relocation_nothing_is_known_of_the_motion():
    motion = prior()
    follow(motion, [1e-6] * 30)
    motion.restart(np.zeros(2))
    assert motion.predict(2_000 * MS).speed == Settings().speed


def test_a_sudden_motion_widens_the_prior_of_its_own_frame():
    narrow = follow(prior(), [1e-6] * 30)[-1].next
    assert not narrow.is_too_narrow(narrow.theta + 1e-5)
    far, farther = (narrow.theta + np.array([step, 0.0]) for step in (4e-3, 0.5))
    assert narrow.is_too_narrow(far)
    wider = narrow.widened(far)
    assert wider.speed == pytest.approx(MARGIN * 4e-3 * 30 / np.sqrt(2), rel=0.01)
    assert wider.is_too_narrow(farther)
    widest = wider.widened(farther)
    assert widest.speed == Settings().speed
    assert not widest.is_too_narrow(narrow.theta + 1.0)


def test_the_innovation_of_an_estimate_that_the_widest_prior_holds_back_is_large():
    motion = prior(speed=0.3)
    assert motion.update(motion.predict(0), np.ones(2), KNOWN).innovation == 0.0
    motion = prior(speed=0.3)
    held = follow(motion, [0.01] * 3)[-1].recent  # 0.01 m in a frame is as far as the prior allows for
    assert held.innovation == pytest.approx(1 / np.sqrt(2), rel=0.01)  # in one of two parameters
    beyond = follow(motion, [0.05], begin=4)[-1].recent
    assert beyond.innovation == pytest.approx(5 / np.sqrt(2), rel=0.01)
