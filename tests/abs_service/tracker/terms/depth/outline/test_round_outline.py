"""A round outline does not show a turn: neither in its gradients, nor in the status of what it bounds."""

import cv2
import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.depth.outline.round_outline import is_round, without_turn
from calib import pose
from calib.camera import Camera

CAMERA = Camera(160, 120, 135.0, 135.0, 79.5, 59.5)
ANGLES = np.linspace(0, 2 * np.pi, 48, endpoint=False)


def circle(angles):
    return np.full_like(angles, 0.12)


def ellipse(angles):
    return 0.12 / np.hypot(np.cos(angles), np.sin(angles) / 0.75)


def hexagon(angles):
    return 0.12 / np.cos((angles + np.pi / 6) % (np.pi / 3) - np.pi / 6)


def seen(radius, tilt):
    """Points (48, 3) [m] on the edge of a flat thing at 0.75 m, and the distances inside its outline in the image."""
    T_so = pose.from_rotation_vector([tilt, tilt / 3, 0.2], [0.013, -0.007, 0.75])
    edge = np.stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(48)], axis=1) * radius(ANGLES)[:, None]
    rays = CAMERA.rays() @ T_so[:3, :3]
    origin = -T_so[:3, :3].T @ T_so[:3, 3]
    x, y = np.moveaxis(origin[:2] - origin[2] / rays[..., 2:] * rays[..., :2], -1, 0)
    mask = np.hypot(x, y) < radius(np.arctan2(y, x))
    inside, outside = (
        cv2.distanceTransform(one.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5) for one in (mask, ~mask)
    )
    return pose.transform(T_so, edge), (inside - outside + ~mask - 0.5).astype(np.float32)


@pytest.mark.parametrize("tilt", [0.0, 0.4, 0.8])
@pytest.mark.parametrize(("radius", "expected"), [(circle, True), (ellipse, False), (hexagon, False)])
def test_discs_are_round_however_they_are_tilted_and_others_are_not(radius, expected, tilt):
    points, inwards = seen(radius, tilt)
    assert is_round(CAMERA, points, inwards, np.zeros(2, np.float32)) == expected


def test_edges_without_neighbourhood_do_not_decide():
    points, inwards = seen(circle, 0.0)
    inwards[:, :80] = np.nan
    assert is_round(CAMERA, points, inwards, np.zeros(2, np.float32))
    assert not is_round(CAMERA, points, inwards[:, :20], np.zeros(2, np.float32))
    assert not is_round(CAMERA, points[:5], inwards, np.zeros(2, np.float32))


def test_without_its_turn_a_gradient_says_nothing_of_it_and_all_of_the_rest():
    points, _ = seen(circle, 0.3)
    by_place = project_with_jacobian(CAMERA, points)[1]
    center, gradients = points.mean(axis=0), np.random.default_rng(0).normal(size=(48, 2))
    normal = np.cross(points[0] - center, points[9] - center)
    turned = np.einsum("kij,kj->ki", by_place, np.cross(normal, points - center))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    left = without_turn(gradients, by_place, points)
    np.testing.assert_allclose(np.vecdot(left, turned), 0, atol=1e-9)
    across = turned[:, ::-1] * (1, -1)
    np.testing.assert_allclose(np.vecdot(left, across), np.vecdot(gradients, across), atol=1e-9)


@pytest.mark.parametrize(("radius", "expected"), [(circle, "DEGRADED"), (hexagon, "TRACKING")])
def test_a_plain_disc_is_held_by_nothing_by_distances_alone(radius, expected):
    inwards = seen(radius, 0.0)[1]
    noise = 0.001 * np.random.default_rng(1).standard_normal(inwards.shape)
    tracker = a.Tracker(CAMERA, a.Nurbs(), noise=a.noise.Constant(0.001), vertices=200)
    found = tracker.track(np.where(inwards > 0, 0.75, 1.5) + noise, time_s=0)
    assert found.status == expected
    assert ("nothing holds the surface along itself" in "".join(found.reasons)) == (expected == "DEGRADED")
