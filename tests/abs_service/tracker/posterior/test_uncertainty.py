"""Covariance of the vertices: exact for a linear model, calibrated otherwise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.posterior.covariance import leverages, propagated, score_covariance, uncorrected_variance
from abs_service.tracker.posterior.curvature import gauss_newton, posterior_covariance
from abs_service.tracker.terms.linearization import Linearization, stack
from abs_service.tracking.observer import Observer
from abs_service.tracking.offsets.vertex_offsets import FixedOffsets, LearntOffsets
from evaluation.method.posterior import coverage
from tests.abs_service.tracker.scenes import CAMERA, plane_distance, sheet
from tests.abs_service.tracking.driving import frame_set, posterior_of
from tests.abs_service.tracking.test_session import MOVING, RIG, SHEET, drive, tracking

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_vertices_of_a_linear_model_scatter_as_their_covariance_says(seed):
    """y = JΘ + noise of known deviation, solved by least squares: the covariance is that of the solutions."""
    generator = np.random.default_rng(seed)
    rows = generator.standard_normal((12, 4))
    covariance = posterior_covariance(gauss_newton([Linearization(np.zeros(12), rows)], 4))
    jacobian = generator.standard_normal((5, 3, 4))
    found = propagated(SparseJacobian.from_dense(jacobian), covariance)
    solutions = jacobian @ np.linalg.pinv(rows)  # what unit noise of every measurement does to a vertex
    np.testing.assert_allclose(found, solutions @ solutions.transpose(0, 2, 1), rtol=1e-6, atol=1e-9 * found.max())


@given(SEEDS)
def test_groups_of_vertices_in_any_order_have_the_covariance_of_the_dense_jacobian(seed):
    generator = np.random.default_rng(seed)
    group = generator.integers(0, 3, 9).astype(np.int32)
    parameters = np.array([generator.permutation(7)[:4] for _ in range(3)], np.int64)
    sparse_jacobian = SparseJacobian(generator.standard_normal((9, 3, 4)), group, parameters, 7)
    root = generator.standard_normal((7, 7))
    expected = np.einsum("nid,de,nje->nij", sparse_jacobian.dense, root @ root.T, sparse_jacobian.dense)
    np.testing.assert_allclose(propagated(sparse_jacobian, root @ root.T), expected, atol=1e-12)


@given(SEEDS)
def test_what_remains_of_the_meshs_own_errors_is_that_of_the_definition(seed):
    generator = np.random.default_rng(seed)
    jacobian, response = generator.standard_normal((7, 3, 6)), generator.standard_normal((6, 7))
    normals, deviation = generator.standard_normal((7, 3)), generator.uniform(0.1, 1, 7)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = uncorrected_variance(normals, deviation, jacobian, response)
    for v in range(7):
        expected = 0.0
        for w in range(7):
            left = jacobian[v] @ response[:, w] + (v == w) * deviation[v] * normals[v]
            expected += (normals[v] @ left) ** 2
        assert found[v] == pytest.approx(expected)


@given(SEEDS)
def test_least_squares_corrects_the_projection_of_the_meshs_own_errors_and_leaves_the_rest(seed):
    """Each vertex's height is measured alike and nothing else is known: σ²(I − Π) remains."""
    generator = np.random.default_rng(seed)
    heights = generator.standard_normal((9, 4))
    jacobian = np.zeros((9, 3, 4))
    jacobian[:, 2] = heights
    response = -np.linalg.inv(heights.T @ heights) @ heights.T * 0.5
    found = uncorrected_variance(np.tile([0.0, 0.0, 1.0], (9, 1)), np.full(9, 0.5), jacobian, response)
    projection = heights @ np.linalg.pinv(heights)
    np.testing.assert_allclose(found, 0.25 * (1 - np.diag(projection)), rtol=1e-6, atol=1e-9)


def sandwich(inverse: np.ndarray, residual: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Covariance of the solutions, of independent residuals."""
    curvature, sensed = np.asarray(np.linalg.inv(inverse), np.float64), [[Linearization(residual, rows)]]
    return (
        inverse @ score_covariance(curvature - rows.T @ rows, sensed, leverages(inverse, sensed), np.ones(1)) @ inverse
    )


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


def test_the_search_answers_each_vertex_s_own_error_as_it_answers_a_motion_of_it_alone():
    """JᵀJE by the derivatives of all residuals by all vertices, which would take a frame's time to make."""
    one = tracking(vertices=120)
    *_, step = drive(one, SHEET, [0, 1])
    assert one.model is not None
    model, theta, exposed = one.model, step.estimate.theta, SHEET.expose(1)[0]
    posterior = posterior_of(model, RIG, exposed)
    frame = posterior.observe(Observer(RIG).observe(frame_set(exposed, 1)))
    offsets = np.random.default_rng(1).normal(0, 1e-3, step.estimate.vertices.shape)
    surface, n = model.deform(theta[None]), len(offsets)
    single = np.zeros((n, 3, n))
    single[np.arange(n), :, np.arange(n)] = offsets
    by_theta, by_offset = (
        stack(posterior.objective.linearize(surface, jacobian), jacobian.dimension).jacobian
        for jacobian in (model.sparse_jacobian(theta), SparseJacobian.from_dense(single))
    )
    expected = by_theta.T @ by_offset
    np.testing.assert_allclose(frame.cross_curvature(theta, offsets), expected, atol=1e-9 * np.abs(expected).max())


def test_what_the_mesh_did_not_know_stays_with_its_vertices_when_they_are_sorted():
    mesh = sheet()
    model = nurbs.Settings((4, 4), 2).of_mesh(mesh)
    assert model.mesh.deviation.shape == (len(mesh.vertices),)
    order = np.random.default_rng(0).permutation(len(mesh.vertices))
    known = type(mesh)(mesh.vertices, mesh.faces, mesh.colors, mesh.chart, deviation=mesh.vertices[:, 0])
    np.testing.assert_array_equal(known.reordered(order).deviation, mesh.vertices[order, 0])


@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_a_mesh_knows_how_far_noise_put_its_vertices_from_the_surface(tilt):
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    true = plane_distance(CAMERA, normal, float(normal @ [0.0, 0.0, 1.0]))
    far, said = [], []
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(0, 4e-3, true.shape)
        mesh = grid_mesh(InitialDetection((true + noise).astype(np.float32), CAMERA, 150))
        far.append((mesh.vertices @ normal - normal @ [0.0, 0.0, 1.0]) ** 2)
        said.append(mesh.deviation**2)
    scatter, expected = np.sqrt(np.mean(np.concatenate(far))), np.sqrt(np.mean(np.concatenate(said)))
    assert scatter == pytest.approx(expected, rel=0.12)
    assert 0.2e-3 < expected < 2e-3


def test_estimates_say_how_well_each_vertex_is_known():
    *_, step = drive(tracking(), SHEET, MOVING)
    covariance = step.estimate.vertex_covariance
    assert covariance.shape == (len(step.estimate.vertices), 3, 3)
    np.testing.assert_allclose(covariance, covariance.transpose(0, 2, 1), rtol=1e-6, atol=1e-15)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert 0.5e-3 < np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()) < 5e-3


def test_without_color_and_outline_it_is_unknown_where_along_the_sheet_a_vertex_is():
    def depth_only(k, frames):
        return [frame for frame in frames if frame.sensor == "tof"]

    objective = likelihood.Settings(outline_px=0.0)
    *_, both = drive(tracking(objective=objective), SHEET, MOVING)
    *_, alone = drive(tracking(objective=objective), SHEET, MOVING, depth_only)
    spread = [np.linalg.eigvalsh(step.estimate.vertex_covariance).mean(axis=0) for step in (both, alone)]
    assert spread[1][2] > 4 * spread[0][2]


@pytest.mark.slow
def test_the_truth_is_inside_the_95_percent_region_as_often_as_it_should_be():
    """The frames of one sequence share their errors: shares scatter by 4 % from one to the next, their mean by 1 %."""
    found = [coverage(f"simulated://sheet?seed={seed}", 120) for seed in range(11, 23)]
    for one in found:
        print(one)
        assert min(one.vertices, one.theta) >= 0.95
        assert one.sensed >= 0.85
        assert one.directions > 12
        assert 0.9 < one.predicted_mm / one.true_mm < 1.9
    assert 0.90 <= np.mean([one.sensed for one in found]) <= 0.99
    assert np.mean([one.vertices for one in found]) <= 0.99


def test_a_vertex_without_the_noise_of_its_mesh_would_claim_too_much(monkeypatch):
    monkeypatch.setattr(LearntOffsets, "update", FixedOffsets.update)
    found = coverage("simulated://sheet?seed=14", 8)
    assert found.theta_only < 0.93 < found.vertices
