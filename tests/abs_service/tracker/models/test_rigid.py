"""The rigid model is SE(3) about the mesh's centroid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.rigid import Rigid
from tests.abs_service.tracker.scenes import sheet

MESH = sheet()
MODEL = Rigid(MESH)
thetas = st.tuples(*[st.floats(-2, 2)] * 6).map(np.array)


def test_at_rest_nothing_moves():
    surface = MODEL.deform(MODEL.rest[None])
    np.testing.assert_allclose(surface.vertices[0].T, MESH.vertices, rtol=0, atol=1e-7)
    np.testing.assert_allclose(surface.normals[0].T, MESH.normals, atol=1e-6)
    assert MODEL.mesh is MESH


@given(thetas, thetas)
def test_it_turns_about_the_centroid_and_then_moves(first, second):
    surface = MODEL.deform(np.stack([first, second]))
    center = MESH.vertices.mean(axis=0)
    for k, theta in enumerate((first, second)):
        R = Rotation.from_rotvec(theta[:3]).as_matrix()
        expected = (R @ (MESH.vertices - center).T).T + center + theta[3:]
        np.testing.assert_allclose(surface.vertices[k].T, expected, atol=1e-6)
        np.testing.assert_allclose(surface.normals[k].T, MESH.normals @ R.T, atol=1e-6)


@given(thetas)
def test_lengths_are_kept(theta):
    vertices = MODEL.deform(theta[None]).vertices[0].T.astype(float)
    (i, j), rest = MESH.edges.T, MESH.vertices
    lengths = np.linalg.norm(vertices[i] - vertices[j], axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(rest[i] - rest[j], axis=1), atol=2e-6)


@pytest.mark.parametrize("parameter", range(6))
def test_scales_move_the_farthest_vertex_by_about_a_metre_per_unit(parameter):
    theta = np.zeros((1, 6))
    theta[0, parameter] = 1e-3 * MODEL.scales[parameter]
    moved = MODEL.deform(theta).vertices[0].T - MESH.vertices
    assert 0.5e-3 < np.linalg.norm(moved, axis=1).max() < 1.01e-3


def test_a_mesh_of_one_point_can_still_be_moved():
    faces, colors = np.array([[0, 1, 2]], np.int32), np.zeros((3, 3), np.float32)
    dot = Rigid(Mesh(np.ones((3, 3)), faces, colors, np.zeros((3, 2))))
    np.testing.assert_allclose(dot.deform(np.array([[0.0, 0, 0, 1, 2, 3]])).vertices[0].T, [[2, 3, 4]] * 3)
