"""The noise of a mesh is no relief: a plane has the normals of a plane, and a relief keeps its own."""

from dataclasses import replace

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.parts.noiseless_normals import noiseless_normals

SIDE, EDGE_M, SIGMA_M = 20, 8e-3, 2e-4


def mesh(height: np.ndarray, deviation: float = SIGMA_M) -> Mesh:
    """A grid of heights (SIDE, SIDE) [m], with the noise that it says it has."""
    right, down = np.meshgrid(np.arange(SIDE) * EDGE_M, np.arange(SIDE) * EDGE_M)
    noise = SIGMA_M * np.random.default_rng(1).standard_normal(height.shape)
    vertices = np.stack([right, down, 0.6 + height + noise], axis=-1).reshape(-1, 3).astype(np.float64)
    faces = triangles(np.arange(SIDE**2).reshape(SIDE, SIDE)).astype(np.int32)
    unknown = np.full((len(vertices), 3), np.nan, np.float32)
    return Mesh(vertices, faces, unknown, vertices[:, :2], deviation=np.full(len(vertices), deviation))


def slopes(normals: np.ndarray) -> float:
    """Root mean square of the normals' deviation from their mean [rad]."""
    return float(np.sqrt(np.mean(np.sum((normals - normals.mean(axis=0)) ** 2, axis=1))))


def test_a_plane_has_the_normals_of_a_plane():
    noisy = mesh(np.zeros((SIDE, SIDE)))
    assert slopes(noisy.normals) > 0.01
    assert slopes(noiseless_normals(noisy)) < 0.1 * slopes(noisy.normals)
    np.testing.assert_allclose(np.linalg.norm(noiseless_normals(noisy), axis=1), 1)


def test_a_relief_and_a_body_keep_their_normals():
    down, right = np.indices((SIDE, SIDE)) * EDGE_M
    waves = 2e-3 * np.sin(right * 2 * np.pi / 0.04) * np.sin(down * 2 * np.pi / 0.04)
    body = np.sqrt(0.12**2 - (right - 0.08) ** 2 - (down - 0.08) ** 2)
    for height in (waves, body):
        noisy = mesh(height)
        assert slopes(noiseless_normals(noisy)) == pytest.approx(slopes(noisy.normals), rel=0.03)
        assert np.median(np.sum(noiseless_normals(noisy) * noisy.normals, axis=1)) > 0.999


def test_the_normals_of_a_file_are_kept():
    known = replace(mesh(np.zeros((SIDE, SIDE))), deviation=np.zeros(()))
    np.testing.assert_array_equal(noiseless_normals(known), known.normals)


def test_a_plane_that_nothing_holds_is_not_said_to_be_tracked():
    """Regression: a polygon on a plane drifted by 109 mm in 60 frames that were all TRACKING."""
    camera, generator = a.Camera(320, 240, fx=320, fy=320, cx=160, cy=120), np.random.default_rng(3)
    tracker, mask = a.Tracker(camera, a.Rigid()), np.zeros((240, 320), np.bool_)
    mask[80:160, 110:210] = True
    images = 0.6 + 8e-4 * generator.standard_normal((20, 240, 320))
    found = [tracker.track(image, time_s=k / 30, mask=mask) for k, image in enumerate(images)]
    assert a.Status.TRACKING not in {one.status for one in found[1:]}
    assert np.median(np.linalg.norm(found[-1].vertices - found[0].vertices, axis=1)) < 0.02
