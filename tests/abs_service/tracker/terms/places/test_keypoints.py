"""Keypoints of a print are recognised however it has moved and turned, and nothing is recognised without one."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from abs_service.tracker.models.base import Surface
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.terms.places.keypoints import (
    MIN_RECOGNIZED,
    NOTHING_RECOGNIZED,
    SIGMA_PX,
    Keypoints,
    Recognized,
)
from abs_service.tracker.terms.places.sift import Grey
from calib import pose
from calib.camera import Camera
from tests.abs_service.tracker.scenes import as_surface, flat, sheet

CAMERA = Camera(320, 240, 400.0, 400.0, 159.5, 119.5)
MESH = sheet(12, 14, height=flat, size=(0.25, 0.2))
DISTANCE_M = float(MESH.vertices[:, 2].mean())


def blobs(seed: int, sigma: float = 3.0) -> Grey:
    """A print of irregular blobs."""
    noise = np.random.default_rng(seed).normal(size=(CAMERA.height, CAMERA.width)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), sigma)
    return np.clip(128 + 60 * smooth / smooth.std(), 0, 255).astype(np.uint8)


def moved(angle: float, right_m: float, nearer: float) -> pose.Pose:
    """A turn around the optical axis, and a motion of what faces the camera."""
    return pose.from_rotation_vector((0, 0, angle), (right_m, 0, DISTANCE_M * (nearer - 1)))


def shown(picture: Grey, T: pose.Pose) -> Grey:
    """The image of the plane of the mesh that has moved, by the homography of that plane."""
    corners = np.array(
        [[-0.2, -0.2, DISTANCE_M], [0.2, -0.2, DISTANCE_M], [0.2, 0.2, DISTANCE_M], [-0.2, 0.2, DISTANCE_M]]
    )
    before, after = CAMERA.project(corners), CAMERA.project(pose.transform(T, corners))
    homography = cv2.getPerspectiveTransform(before.astype(np.float32), after.astype(np.float32))
    return np.asarray(
        cv2.warpPerspective(picture, homography, (CAMERA.width, CAMERA.height), borderValue=128), np.uint8
    )


def surface_at(T: pose.Pose) -> Surface:
    return as_surface((pose.transform(T, MESH.vertices), MESH.normals @ T[:3, :3].T))


def recognized(first: Grey, later: Grey) -> Recognized:
    keypoints, at_first = Keypoints(CAMERA), surface_at(pose.identity())
    keypoints.observe(lambda: first, at_first).learn(at_first)
    return keypoints.observe(lambda: later, at_first).recognized


@pytest.mark.parametrize("kind", [lambda image: image, lambda image: (0.01 * image - 0.2).astype(np.float32)])
@pytest.mark.parametrize(("angle", "right_m", "nearer"), [(0.0, 0.06, 1.0), (2.2, 0.0, 1.0), (np.pi, -0.03, 1.2)])
def test_a_print_that_has_moved_turned_and_come_nearer_is_recognised(kind: Callable, angle, right_m, nearer):
    T, picture = moved(angle, right_m, nearer), blobs(1)
    found = recognized(kind(picture), kind(shown(picture, T)))
    there = pose.transform(T, MESH.vertices)
    assert len(found.seen) > 3 * MIN_RECOGNIZED
    assert found.apart(there) < 0.7
    assert found.apart(MESH.vertices) > 15
    np.testing.assert_allclose(found.moved(MESH.vertices), there, atol=0.004)


def test_a_camera_of_a_rig_sees_the_rigid_motion_in_the_rig():
    T_rs, T = pose.from_rotation_vector((0.2, -0.3, 0.1), (0.4, 0.1, -0.2)), moved(2.2, 0.02, 1.0)
    found = recognized(picture := blobs(1), shown(picture, T))
    of_rig = replace(found, camera=replace(CAMERA, T_rs=T_rs))
    before, there = (pose.transform(T_rs, vertices) for vertices in (MESH.vertices, pose.transform(T, MESH.vertices)))
    np.testing.assert_allclose(of_rig.moved(before), there, atol=0.004)


def test_nothing_is_recognised_without_a_print_in_another_one_and_before_any_is_known():
    blank, picture = np.full((CAMERA.height, CAMERA.width), 100, np.uint8), blobs(1)
    assert recognized(blank, blank) is NOTHING_RECOGNIZED
    assert recognized(picture, blank) is NOTHING_RECOGNIZED
    assert Keypoints(CAMERA).observe(lambda: picture, surface_at(pose.identity())).recognized is NOTHING_RECOGNIZED
    other = recognized(picture, blobs(2))
    assert other is NOTHING_RECOGNIZED or other.apart(MESH.vertices) > 15
    assert np.isinf(NOTHING_RECOGNIZED.apart(MESH.vertices))


def test_a_part_of_a_pattern_that_repeats_itself_is_not_all_of_it():
    tile, pattern = (slice(80, 120), slice(120, 160)), np.tile(np.asarray(blobs(1, 2.0)[:40, :40], np.uint8), (6, 8))
    part = np.full(pattern.shape, 128, np.uint8)
    part[tile] = pattern[tile]
    assert recognized(pattern, part) is NOTHING_RECOGNIZED


def test_a_mesh_beside_the_image_is_looked_for_in_all_of_it():
    picture = blobs(1)
    beside = surface_at(pose.from_rotation_vector((0, 0, 0), (2.0, 0, 0)))
    keypoints = Keypoints(CAMERA)
    keypoints.observe(lambda: picture, surface_at(pose.identity())).learn(surface_at(pose.identity()))
    found = keypoints.observe(lambda: picture, beside).recognized
    assert found.apart(MESH.vertices) < 0.5


def test_the_first_image_is_learnt_and_no_later_one():
    keypoints, at = Keypoints(CAMERA), surface_at(pose.identity())
    keypoints.observe(lambda: blobs(1), at).learn(at)
    known = keypoints.known
    keypoints.observe(lambda: blobs(2), at).learn(at)
    assert keypoints.known is known


def test_residuals_tell_the_way_and_wrong_matches_weigh_little():
    picture, model = blobs(1), Rigid(MESH)
    found = recognized(picture, picture)
    wrong = Recognized(CAMERA, found.corners, found.weights, found.seen.copy())
    wrong.seen[0] += 80
    at, jacobian = surface_at(pose.identity()), model.sparse_jacobian(model.rest)
    true, outlier = (one.linearize(at, jacobian) for one in (found, wrong))
    assert np.quantile(np.abs(true.residual), 0.95) < 0.1 / SIGMA_PX
    np.testing.assert_allclose(outlier.residual[2:], true.residual[2:])
    assert np.abs(outlier.residual[:2]).max() < 8 / SIGMA_PX
    step = np.array([0.001, -0.002, 0.0015])  # of all vertices, and so of every keypoint
    before, after = (CAMERA.project(found.moved(MESH.vertices) + s * step) for s in (0, 1))
    by_rows, expected = (true.rows @ step).reshape(-1, 2).mean(axis=0), (after - before).mean(axis=0) / SIGMA_PX
    np.testing.assert_allclose(by_rows, expected, rtol=0.15)
