"""Heights of measured points above a mesh, vertex by vertex."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import DepthImage
from abs_service.tracking.offsets.heights import HeightSensor
from calib import pose
from calib.noise.constant import Constant
from tests.abs_service.tracking.offsets.offset_sheet import CAMERA, NOISE, SIGMA, flat_mesh, image

MESH = flat_mesh()
N = len(MESH.vertices)
AWAY = np.tile([0.0, 0.0, -1.0], (N, 1))


def reference(camera, picture, vertex, normal, variance, offset):
    """Mean height and precision of one vertex, pixel by pixel, within 4 / √π px of the vertex's own."""
    sight = vertex - camera.center
    cosine = abs(sight @ normal) / np.linalg.norm(sight)
    column, row = np.floor(camera.project(vertex[None])[0] + 0.5).astype(int)
    heights, inside = [], 2 <= column < camera.width - 2 and 2 <= row < camera.height - 2
    disc = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if np.hypot(i, j) <= 4 / np.sqrt(np.pi)]
    for i, j in disc if inside and cosine > 0.3 else []:
        measured = float(np.nan_to_num(picture.distance[row + i, column + j])) - offset
        ray = camera.T_rs[:3, :3] @ camera.directions(np.array([column + j, row + i]))
        height = (measured * ray - sight) @ normal
        if abs(height) < 3 * np.sqrt((SIGMA * cosine) ** 2 + variance):
            heights.append(height)
    if 2 * len(heights) <= len(disc):
        return 0.0, 0.0
    return np.mean(heights), len(heights) / (SIGMA * cosine) ** 2


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32))
def test_heights_are_those_of_the_reference(seed):
    generator = np.random.default_rng(seed)
    noise = Constant(SIGMA, 3e-3)
    T_rs = pose.from_rotation_vector(0.05 * generator.standard_normal(3), 0.02 * generator.standard_normal(3))
    camera = replace(CAMERA, T_rs=T_rs)
    mesh = replace(MESH, vertices=pose.transform(T_rs, MESH.vertices))
    vertices = mesh.vertices + generator.uniform(-0.01, 0.01, (N, 3))
    normals = AWAY + 0.6 * generator.standard_normal((N, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    z = 1 + 4e-3 * generator.standard_normal((CAMERA.height, CAMERA.width))
    z[generator.uniform(size=z.shape) < 0.3] = np.nan
    variance = generator.uniform(0, 2e-3, N) ** 2
    found = HeightSensor(camera, noise, mesh).measure(image(z), vertices, normals, variance)
    expected = [reference(camera, image(z), *each, 3e-3) for each in zip(vertices, normals, variance, strict=True)]
    np.testing.assert_allclose(np.transpose([found.mean, found.precision]), np.array(expected), rtol=1e-9, atol=1e-9)


def test_a_slope_is_no_height():
    """A sheet seen obliquely: the distance changes from pixel to pixel, and every point is in the same plane."""
    normal = np.array([0.6, 0.0, -0.8])
    rays = CAMERA.lookup.rays
    distance = (MESH.vertices[N // 2] @ normal) / (rays @ normal)
    vertices = CAMERA.directions(CAMERA.project(MESH.vertices) + 0.4)
    vertices *= ((MESH.vertices[N // 2] @ normal) / (vertices @ normal))[:, None]
    picture = DepthImage(distance.astype(np.float32), np.full(distance.shape, np.nan, np.float32))
    found = HeightSensor(CAMERA, NOISE, MESH).measure(picture, vertices, np.tile(normal, (N, 1)), np.zeros(N))
    assert np.count_nonzero(found.precision) > 0.9 * N
    np.testing.assert_allclose(found.mean, 0, atol=1e-6)


@pytest.mark.parametrize("change", [np.nan, 0.9, 1.1])
def test_a_vertex_whose_pixels_show_something_else_is_not_measured(change):
    z = np.ones((CAMERA.height, CAMERA.width))
    z[:, :32] = change
    found = HeightSensor(CAMERA, NOISE, MESH).measure(image(z), MESH.vertices, AWAY, np.full(N, 1e-6))
    left = CAMERA.project(MESH.vertices)[:, 0] < 30
    assert not found.precision[left].any()
    assert found.precision[CAMERA.project(MESH.vertices)[:, 0] > 34].all()
