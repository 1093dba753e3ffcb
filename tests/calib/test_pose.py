"""Poses form a group, and every representation of one says the same."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from calib import pose

vectors = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)
poses = st.builds(pose.from_rotation_vector, vectors, vectors)


@given(poses, poses, poses)
def test_poses_are_a_group(a, b, c):
    assert pose.is_pose(a @ b)
    np.testing.assert_allclose(a @ (b @ c), (a @ b) @ c, atol=1e-12)
    np.testing.assert_allclose(a @ pose.inverse(a), pose.identity(), atol=1e-12)
    np.testing.assert_allclose(pose.inverse(a @ b), pose.inverse(b) @ pose.inverse(a), atol=1e-12)


@given(poses, poses, vectors)
def test_points_are_transformed_as_the_names_say(T_ab, T_bc, p_c):
    stepwise = pose.transform(T_ab, pose.transform(T_bc, p_c))
    np.testing.assert_allclose(pose.transform(T_ab @ T_bc, p_c), stepwise, atol=1e-11)
    np.testing.assert_allclose((T_ab @ T_bc @ [*p_c, 1])[:3], stepwise, atol=1e-11)


@given(poses, st.lists(vectors, min_size=2, max_size=2))
def test_distances_and_handedness_are_kept(T_ab, points):
    moved = pose.transform(T_ab, np.array(points))
    assert np.linalg.norm(moved[0] - moved[1]) == pytest.approx(np.linalg.norm(points[0] - points[1]), abs=1e-12)
    assert np.linalg.det(T_ab[:3, :3]) == pytest.approx(1)


@given(st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array), vectors)
def test_rotation_vectors_shorter_than_half_a_turn_come_back(rotation_vector, translation):
    again = pose.to_rotation_vector(pose.from_rotation_vector(rotation_vector, translation))
    np.testing.assert_allclose(again[0], rotation_vector, atol=1e-9)
    np.testing.assert_array_equal(again[1], translation)


@given(poses)
def test_the_quaternion_is_the_rotation(T_ab):
    x, y, z, w = pose.to_quaternion(T_ab)
    assert np.linalg.norm([x, y, z, w]) == pytest.approx(1)
    rotated = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])  # of the x axis
    np.testing.assert_allclose(rotated, T_ab[:3, 0], atol=1e-9)


def test_many_points_at_once_keep_their_shape():
    T_ab = pose.from_rotation_vector([0, 0, np.pi / 2], [1, 2, 3])
    points = np.tile([1.0, 0.0, 0.0], (2, 5, 1))
    np.testing.assert_allclose(pose.transform(T_ab, points), np.tile([1.0, 3.0, 3.0], (2, 5, 1)), atol=1e-15)


def test_a_camera_looks_at_its_target():
    T_rs = pose.look_at([1, 2, 3], [1, 2, 8])
    np.testing.assert_allclose(T_rs[:3, :3], np.eye(3), atol=1e-15)
    T_rs = pose.look_at([0.3, -0.2, 0.1], [0.5, 0.4, 2.0])
    assert pose.is_pose(T_rs)
    x, y, z = pose.transform(pose.inverse(T_rs), np.array([0.5, 0.4, 2.0]))
    assert (x, y) == pytest.approx((0, 0), abs=1e-12)
    assert z > 0
    assert T_rs[1, 1] > 0  # rows run along the rig's y axis


BROKEN = np.eye(4)[[1, 0, 2, 3]]  # a mirror


@pytest.mark.parametrize("matrix", [2 * np.eye(4), BROKEN, np.full((4, 4), np.nan), np.eye(4) + np.eye(4)[::-1]])
def test_what_is_no_pose_is_recognised(matrix):
    assert not pose.is_pose(matrix)


@given(vectors | vectors.map(lambda v: v * 1e-3) | vectors.map(lambda v: v * 1e-8), vectors)
def test_turned_points_follow_the_rotation_vector_as_their_derivatives_say(rotation_vector, point):
    steps = 1e-6 * np.eye(3)
    ahead, behind = (
        [pose.from_rotation_vector(rotation_vector + sign * step, (0, 0, 0))[:3, :3] @ point for step in steps]
        for sign in (1, -1)
    )
    turned = pose.transform(pose.from_rotation_vector(rotation_vector, (0, 0, 0)), point[None])
    expected = (np.array(ahead) - behind).T / 2e-6
    np.testing.assert_allclose(pose.rotated_points_jacobian(rotation_vector, turned)[0], expected, rtol=0, atol=1e-8)


@given(vectors)
def test_the_rotation_between_points_is_that_which_turned_them(rotation_vector):
    turn = pose.from_rotation_vector(rotation_vector, (0, 0, 0))[:3, :3]
    points = np.random.default_rng(0).normal(size=(20, 3))
    noisy = points @ turn.T + np.random.default_rng(1).normal(0, 0.01, (20, 3))
    found = pose.nearest_rotation(noisy.T @ points)
    expected = scipy.spatial.transform.Rotation.align_vectors(noisy, points)[0].as_matrix()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found, turn, rtol=0, atol=0.02)


def test_flat_points_are_turned_and_not_mirrored():
    flat = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    assert pose.is_pose(np.block([[pose.nearest_rotation(flat.T @ flat), np.zeros((3, 1))], [np.eye(4)[3]]]))
