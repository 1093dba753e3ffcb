"""The compiled projection equals that of the camera, and the regression over edges equals its definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.synthesis.perspective import SHORT_EDGE_PX, image_gradients, project_with_jacobian
from calib.camera import Camera
from calib.lenses.lens import Lens
from tests.abs_service.tracker.scenes import CAMERA, FISHEYE, sheet

RATIONAL = Camera(
    64, 48, 150.0, 152.0, 31.2, 23.9, Lens(np.array([0.1, 0.02, 1e-3, -2e-3, 0.01, 0.05, 0.01, 0.002])), CAMERA.T_rs
)


@pytest.mark.parametrize("camera", [CAMERA, RATIONAL, FISHEYE], ids=["brown", "rational", "fisheye"])
@given(st.integers(0, 2**32 - 1))
def test_places_and_jacobian_are_the_camera_s(camera, seed):
    points = np.random.default_rng(seed).uniform([-0.2, -0.15, 0.8], [0.2, 0.15, 1.2], (9, 3))
    places, jacobian = project_with_jacobian(camera, points)
    np.testing.assert_allclose(places, camera.project(points), rtol=0, atol=1e-9)
    np.testing.assert_allclose(jacobian, camera.projection_jacobian(points), rtol=0, atol=1e-8)


def test_what_is_behind_the_camera_has_no_place():
    places, _ = project_with_jacobian(CAMERA, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]))
    assert np.isnan(places[0]).all()
    assert np.isfinite(places[1]).all()


@given(st.integers(0, 2**32 - 1))
def test_edges_tell_how_attributes_change_in_the_image(seed):
    generator, mesh = np.random.default_rng(seed), sheet(4, 5)
    vertices = mesh.vertices + generator.normal(0, 0.01, mesh.vertices.shape)
    vertices[3] = [0, 0, -1]
    lengths = generator.normal(0, 0.02, (2, len(mesh.edges), 2))
    place = CAMERA.project(vertices)
    expected = np.empty((len(vertices), 2, 2))
    for v in range(len(vertices)):
        square, mixed = SHORT_EDGE_PX**2 * np.eye(2), np.zeros((2, 2))
        for e, (i, j) in enumerate(mesh.edges):
            seen = place[j] - place[i]
            if v in (i, j) and np.isfinite(seen).all():
                square += np.outer(seen, seen)
                mixed += np.outer(lengths[int(v == j), e], seen)
        expected[v] = mixed @ np.linalg.inv(square)
    per_metre = generator.standard_normal((len(vertices), 3, 2))
    found = image_gradients(CAMERA, vertices, mesh.edges, lengths, per_metre)
    np.testing.assert_allclose(found, per_metre @ expected, rtol=1e-5, atol=1e-7)
