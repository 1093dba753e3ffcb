"""The mesh's own errors, and what the search corrects of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.posterior.covariance.mesh_noise import uncorrected_variance
from abs_service.tracker.terms.linearization import stack
from tests.abs_service.tracker.scenes import CAMERA, plane_distance, sheet
from tests.abs_service.tracking.driving import frame_posterior_of
from tests.abs_service.tracking.test_session import RIG, SHEET, drive, tracking

SEEDS = st.integers(0, 2**32 - 1)


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


def test_the_search_answers_each_vertex_s_own_error_as_it_answers_a_motion_of_it_alone():
    """JᵀJE by the derivatives of all residuals by all vertices, which would take a frame's time to make."""
    one = tracking(vertices=120)
    *_, step = drive(one, SHEET, [0, 1])
    assert one.model is not None
    model, theta, exposed = one.model, step.estimate.theta, SHEET.expose(1)[0]
    frame = frame_posterior_of(model, RIG, exposed, exposed)
    offsets = np.random.default_rng(1).normal(0, 1e-3, step.estimate.vertices.shape)
    surface, n = model.deform(theta[None]), len(offsets)
    single = np.zeros((n, 3, n))
    single[np.arange(n), :, np.arange(n)] = offsets
    by_theta, by_offset = (
        stack(frame.objective.linearize(surface, jacobian), jacobian.dimension).jacobian
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
