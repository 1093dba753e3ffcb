"""Residuals and their derivatives are those of the cost, on surfaces that are smooth enough for derivatives."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.models.nurbs import Settings
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracker.posterior.covariance.sandwich import leverages
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.settings import Settings as PriorSettings
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.observed_depth import ObservedDepth
from abs_service.tracker.terms.gradients import depth_rows
from abs_service.tracker.terms.linearization import (
    Linearization,
    PointLinearization,
    add_gradients,
    add_squares,
    stack,
)
from calib.camera import Camera
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import as_surface, depth_image, observation, plane_distance, sheet, sparse
from tests.abs_service.tracker.terms.residual_changes import central_difference

#: Many fine pixels, so that rounding to one of them is small against the steps of the derivatives.
FINE = Camera(640, 480, 1500.0, 1500.0, 319.5, 239.5)
MESH = sheet(height=lambda x, y: 1.0 + 0.2 * x - 0.1 * y)
NORMAL = np.array([-0.2, 0.1, 1.0])
SIGMA = 5e-3
BOUNDS = Bounds(0.05, 1.6, 4.6)


def depth_term() -> ObservedDepth:
    term = DepthTerm("tof", sparse(FINE, MESH), MESH, GaussianPolynomial(((SIGMA,),)), BOUNDS)
    return term.observe(
        depth_image(plane_distance(FINE, NORMAL, 1.0)), Prediction(as_surface((MESH.vertices, MESH.normals)))
    )


def test_depth_rows_predict_what_the_plane_s_residuals_do():
    """The derivative is exact for a plane that is parallel to the mesh: a vertex takes its pixel along."""
    model, term = Rigid(MESH), depth_term()
    theta = np.array([0, 0, 0, 2e-3, -1e-3, 3e-3])
    there = model.deform(theta[None])
    linear = stack(term.linearize(there, model.sparse_jacobian(theta)), 6)
    assert len(linear.residual) == len(MESH.vertices)
    for step in np.diag([0.02, 0.02, 0.1, 0.02, 0.04, 5e-3]):
        predicted = linear.jacobian @ step
        actual = central_difference(term, model, theta, step)
        np.testing.assert_allclose(actual, predicted, atol=0.1)  # pixels are 0.7 mm wide
        assert np.abs(predicted).max() > 0.4


def test_depth_residuals_are_normalised_differences():
    model, term = Rigid(MESH), depth_term()
    nearer = np.array([0, 0, 0, 0, 0, -SIGMA])
    linear = stack(term.linearize(model.deform(nearer[None]), model.sparse_jacobian(nearer)), 6)
    sight = MESH.vertices / np.linalg.norm(MESH.vertices, axis=1, keepdims=True)
    gap = SIGMA * NORMAL[2] / (sight @ NORMAL)  # along the ray, from a plane moved by σ along z
    np.testing.assert_allclose(linear.residual, gap / SIGMA, atol=0.04)
    np.testing.assert_allclose(linear.jacobian[:, 5], -gap / SIGMA**2, rtol=0.02)


def drawn(generator: np.random.Generator, count: int) -> PointLinearization:
    """Residuals of nine points in some order, in groups of four out of seven parameters."""
    group = np.sort(generator.integers(0, 3, 9)).astype(np.int32)
    parameters = np.stack([generator.permutation(7)[:4] for _ in range(3)])
    sparse_jacobian = SparseJacobian(generator.standard_normal((9, 3, 4)), group, parameters, 7)
    points, rows = generator.integers(0, 9, count), generator.standard_normal((count, 3))
    rows[generator.random(count) < 0.3, 0] = 0.0
    positions, shared = generator.standard_normal((9, 3)), generator.standard_normal((count, 2))
    residual = generator.standard_normal(count)
    return PointLinearization(residual, rows, points, sparse_jacobian, positions, lambda: shared)


@given(st.integers(0, 2**32 - 1), st.integers(0, 20))
def test_residuals_of_points_are_those_of_their_dense_jacobian(seed, count):
    generator = np.random.default_rng(seed)
    linear = drawn(generator, count)
    expected = np.stack([row @ linear.sparse_jacobian.dense[v] for row, v in zip(linear.rows, linear.points)] or [[]])
    dense = Linearization(linear.residual, expected.reshape(count, 7))
    np.testing.assert_allclose(linear.jacobian, dense.jacobian, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(linear.places, linear.positions[linear.points])
    np.testing.assert_allclose(linear.shared_gradients(), linear.shared().T @ dense.jacobian, rtol=0, atol=1e-12)
    step, clusters, half = generator.standard_normal(7), generator.integers(0, 3, count), generator.random((7, 7))
    np.testing.assert_allclose(linear.moved(step).residual, dense.moved(step).residual, rtol=0, atol=1e-12)
    by_cluster = [linear.residual[clusters == c] @ dense.jacobian[clusters == c] for c in range(3)]
    for part in (linear, dense):
        scores = np.ones((3, 7))
        part.add_scores(clusters, scores)
        np.testing.assert_allclose(scores, 1 + np.array(by_cluster), rtol=0, atol=1e-12)
    found, leverage = leverages(half + half.T, [linear, dense])
    expected = np.einsum("md,de,me->m", dense.jacobian, half + half.T, dense.jacobian)
    np.testing.assert_allclose(leverage, expected, rtol=0, atol=1e-11)
    single = np.einsum("md,de,me->m", *(np.abs(one) for one in (dense.jacobian, half + half.T, dense.jacobian)))
    assert (np.abs(found - expected) <= 1e-5 * single.max(initial=0)).all()


@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.integers(0, 20))
def test_gradients_of_sensors_are_added_up(seed, count, other):
    generator = np.random.default_rng(seed)
    one, two = drawn(generator, count), drawn(generator, other)
    parts = [one, replace(two, sparse_jacobian=one.sparse_jacobian), two]
    gradient = np.ones(7)
    add_gradients(parts, gradient)
    expected = sum((part.jacobian.T @ part.residual for part in parts), np.ones(7))
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-12)
    dense = Linearization(one.residual, one.jacobian)
    dense.add_gradient(gradient)
    np.testing.assert_allclose(gradient, expected + one.jacobian.T @ one.residual, rtol=0, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.integers(0, 20))
def test_squares_of_sensors_that_measure_the_same_points_are_added_up(seed, count, other):
    """Also of points with one row or with two, whose matrices are singular."""
    generator = np.random.default_rng(seed)
    one, two = drawn(generator, count), drawn(generator, other)
    parts = [one, replace(two, sparse_jacobian=one.sparse_jacobian), two, Linearization(np.ones(3), np.eye(3, 7))]
    weights, total = [generator.random(len(part.residual)) for part in parts], np.ones((7, 7))
    add_squares(parts, weights, total)
    products = ((part.jacobian.T * own) @ part.jacobian for part, own in zip(parts, weights))
    np.testing.assert_allclose(total, 1 + sum(products), rtol=0, atol=1e-12)


def test_grazing_views_do_not_explode():
    normals = np.array([[0.0, 0, -1], [1, 0, -1e-4]]) / [[1], [np.hypot(1, 1e-4)]]
    rows = depth_rows(np.array([[0.0, 0, 1], [0, 0, 1]]), normals, np.zeros(3), np.arange(2), np.ones(2))
    np.testing.assert_allclose(rows[0], [0, 0, -1])
    assert np.linalg.norm(rows[1]) == pytest.approx(5)


@pytest.mark.parametrize("objective", [likelihood.Settings(), euclidean.Settings(cutoff_m=0.06, cutoff_levels=100.0)])
@pytest.mark.parametrize("deviations", [0.0, 2.9, 3.3, 3.7, 5.0, 7.0])
def test_what_costs_less_than_an_outlier_is_linearized_whatever_the_objective(objective, deviations):
    """Or a descent would ignore what its cost is made of: then it stops where that is not least."""
    noise, mesh = GaussianPolynomial(((0.01,),)), MESH
    distance = plane_distance(FINE, NORMAL, 1.0)
    rig = Rig("r", {"tof": Sensor("tof", FINE, noise)})
    found = objective.build(rig, mesh, sparse(FINE, mesh))
    found = found.observe(observation(0, (), tof=depth_image(distance)), as_surface((mesh.vertices, mesh.normals)))
    along = np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    nearer = as_surface((mesh.vertices * (1 - 0.01 * deviations / along), mesh.normals))
    costs = [
        float(found.cost(as_surface((mesh.vertices * (1 - (0.01 * deviations + by) / along), mesh.normals)))[0])
        for by in (-1e-4, 1e-4)
    ]
    linear = stack(found.linearize(nearer, SparseJacobian.from_dense((mesh.vertices / along)[:, :, None])), 1)
    gradient = -(linear.jacobian.T @ linear.residual)[0]
    np.testing.assert_allclose((costs[1] - costs[0]) / 2e-4, gradient, rtol=0.02, atol=20.0)


def test_only_inliers_and_what_is_in_free_space_are_linearized():
    mesh = MESH
    distance = plane_distance(FINE, NORMAL, 1.0)
    surface = as_surface((mesh.vertices, mesh.normals))
    view = sparse(FINE, mesh).view("tof", np.zeros((len(mesh.vertices), 0), np.float32))
    around = cv2.dilate(np.isfinite(view.render(surface)).astype(np.uint8), np.ones((5, 5))) > 0
    distance[around & (np.arange(640) < 320)] = np.nan  # a hole in the object, not a background without return
    distance[:240] += 1
    term = DepthTerm("tof", sparse(FINE, mesh), mesh, GaussianPolynomial(((SIGMA,),)), BOUNDS)
    term = term.observe(depth_image(distance), Prediction(surface))
    linear = stack(term.linearize(surface, SparseJacobian.from_dense(np.zeros((len(mesh.vertices), 3, 2)))), 2)
    pixels = FINE.project(mesh.vertices) + 0.5
    inliers = np.count_nonzero((pixels[:, 0] >= 320) & (pixels[:, 1] >= 240))
    free = np.count_nonzero((pixels[:, 0] >= 320) & (pixels[:, 1] < 240))
    assert len(linear.residual) == inliers + free
    assert np.abs(linear.residual[:inliers]).max() < 0.2
    fit = term.fit(surface)
    assert fit.inliers == inliers
    assert fit.visible + fit.occluded == len(mesh.vertices)
    assert fit.occluded > 0.6 * np.count_nonzero(pixels[:, 0] < 320)  # the half without returns, but for its rim
    assert fit.samples == np.count_nonzero(pixels[:, 0] >= 320)
    assert fit.normalized_residual < 0.2


def test_stretch_rows_are_derivatives_of_the_stretch_cost():
    model = Settings(control_points=(4, 4)).of_mesh(sheet(5, 6))
    prior = StretchPrior(model.mesh, 0.02)
    theta = model.rest + np.random.default_rng(2).normal(0, 3e-3, len(model.rest))
    linear = stack(prior.linearize(model.deform(theta[None]), model.sparse_jacobian(theta)), len(theta))
    assert 0.5 * np.sum(linear.residual**2) == pytest.approx(prior.cost(model.deform(theta[None]))[0], rel=1e-3)
    gradient, h = linear.jacobian.T @ linear.residual, 1e-4
    offsets = h * np.eye(len(theta))
    costs = prior.cost(model.deform(np.concatenate([theta + offsets, theta - offsets])))
    numerical = (costs[: len(theta)] - costs[len(theta) :]) / (2 * h)
    np.testing.assert_allclose(gradient, numerical, atol=0.02 * np.abs(numerical).max())


def test_the_motion_cost_is_that_of_its_precision():
    motion = MotionPrior(
        np.array([1.0, 2.0]), ChangeMetric(np.array([1.0, 3.0]), np.array([[1.0, -2.0]])), PriorSettings(speed=0.3)
    )
    prior = motion.predict(0)
    for change in (np.zeros(2), np.array([0.02, 0.01]), np.array([0.03, -0.01])):
        expected = 0.5 * change @ prior.precision @ change
        assert prior.cost((prior.theta + change)[None])[0] == pytest.approx(expected)


def test_linearizations_are_stacked_also_if_there_is_none():
    assert stack([], 3).jacobian.shape == (0, 3)
    parts = [Linearization(np.ones(k), np.full((k, 3), k)) for k in (1, 2)]
    assert stack(parts, 3).jacobian.tolist() == [[1, 1, 1], [2, 2, 2], [2, 2, 2]]
