"""Compiled synthesis computes what its equations say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.sparse import HIDING_M, hide
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from tests import reference
from tests.abs_service.tracker.scenes import (
    CAMERA,
    FISHEYE,
    as_surface,
    seen,
)
from tests.abs_service.tracker.synthesis.random_vertices import decided, few, scattered, seeds, undecided


@few
@given(seeds)
def test_synthesis_is_eqs_10_11_and_20(seed):
    vertices, normals = decided(np.random.default_rng(seed), 40)
    synthesis = seen(CAMERA, as_surface((vertices, normals)))
    pixels = [reference.seen_pixel(CAMERA, *pair) for pair in zip(vertices.astype(float), normals)]
    # With a border of one pixel, pixel (row, column) is at (row + 1, column + 1).
    stride = CAMERA.width + 2
    expected = [0 if pixel is None else (pixel[0] + 1) * stride + pixel[1] + 1 for pixel in pixels]
    assert synthesis.pixel[0].tolist() == expected
    distances = [
        reference.distance_at_center(CAMERA, *pair) for pair in zip(vertices.astype(float), normals.astype(float))
    ]
    np.testing.assert_allclose(synthesis.distance[0], distances, rtol=1e-5)


@few
@given(seeds)
def test_synthesis_through_a_fisheye_is_the_same_equations(seed):
    vertices, normals = scattered(np.random.default_rng(seed), 40, width=5.0)
    keep = ~undecided(FISHEYE, vertices, normals)
    surface = as_surface((vertices[keep], normals[keep]))
    synthesis = seen(FISHEYE, surface)
    pairs = list(zip(vertices[keep].astype(float), normals[keep].astype(float)))
    pixels = [reference.seen_pixel(FISHEYE, *pair) for pair in pairs]
    stride = FISHEYE.width + 2
    assert synthesis.pixel[0].tolist() == [0 if p is None else (p[0] + 1) * stride + p[1] + 1 for p in pixels]
    distances = [reference.distance_at_center(FISHEYE, *pair) for pair in pairs]
    np.testing.assert_allclose(synthesis.distance[0], distances, rtol=2e-5)
    place, inverse_z = Projection(FISHEYE).project(surface.vertices)
    found = np.isfinite(inverse_z[0])
    assert found[synthesis.pixel[0] > 0].all()
    expected = FISHEYE.project(surface.vertices[0].T.astype(float))
    np.testing.assert_allclose(place[0, found], expected[found], atol=1e-3)


@few
@given(seeds)
def test_without_distortion_a_shorter_kernel_says_the_same(seed):
    """A lens too weak to move anything by a thousandth of a pixel chooses the other kernel."""
    vertices, normals = decided(np.random.default_rng(seed), 40)
    plain, weak = (replace(CAMERA, lens=Lens(np.array([k1]))) for k1 in (0.0, 1e-9))
    keep = ~undecided(plain, vertices, normals)
    surface = as_surface((vertices[keep], normals[keep]))
    one, other = seen(plain, surface), seen(weak, surface)
    assert np.array_equal(one.pixel, other.pixel)
    np.testing.assert_allclose(one.distance, other.distance, rtol=1e-6)


@few
@given(seeds)
def test_a_plane_is_as_far_as_the_pixels_that_see_it_measure(seed):
    """Wherever on it the vertices are; the lens bends half a pixel by a few per cent, which is ignored."""
    generator = np.random.default_rng(seed)
    n = np.array([*generator.uniform(-1, 1, 2), -1.0])
    n /= np.linalg.norm(n)
    middle = pose.transform(CAMERA.T_rs, np.array([0.0, 0.0, 1.0]))
    across = np.linalg.svd(n[None])[2][1:]
    vertices = (middle + generator.uniform(-0.15, 0.15, (40, 2)) @ across).astype(np.float32)
    synthesis = seen(CAMERA, as_surface((vertices, np.tile(n, (40, 1)).astype(np.float32))))
    row, column = np.divmod(synthesis.pixel[0], CAMERA.width + 2)
    sight = CAMERA.directions(np.stack([column - 1, row - 1], axis=-1)) @ CAMERA.T_rs[:3, :3].T
    measured = (middle - CAMERA.center) @ n / (sight @ n)
    vertex = np.linalg.norm(vertices - CAMERA.center, axis=1)
    beside = synthesis.pixel[0] > 0
    off, moved = np.abs(synthesis.distance[0] - measured)[beside], np.abs(vertex - measured)[beside]
    assert np.all(off < 0.1 * moved + 5e-5)


def test_what_is_behind_the_camera_or_faces_away_is_pixel_0():
    camera = Camera(8, 6, 10.0, 10.0, 3.5, 2.5)
    vertices = np.array([[0, 0, 1], [0, 0, -1], [0, 0, 0], [0, 0, 1], [np.nan, 0, 1]], np.float32)
    normals = np.array([[0, 0, -1], [0, 0, 1], [0, 0, -1], [0, 0, 1], [0, 0, -1]], np.float32)
    with np.errstate(all="ignore"):
        pixel = seen(camera, as_surface((vertices, normals))).pixel[0]
    assert pixel[0] > 0
    assert pixel[1:].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize("coefficients", [[0.0], [-0.3], [0, 0, 0, 0, 9.0], [5.2, 3.4, 0, 0, 0.2, 5.5, 5.1, 0.9]])
def test_no_vertex_however_far_aside_reads_outside_the_texture(coefficients):
    camera = Camera(8, 6, 10.0, 10.0, 3.5, 2.5, Lens(np.array(coefficients)))
    generator = np.random.default_rng(1)
    direction = generator.normal(size=(400, 3)) * 10.0 ** generator.uniform(-7, 7, (400, 3))
    vertices = np.abs(direction) * np.sign(generator.normal((0, 0, 9), 1.0, (400, 3)))
    with np.errstate(all="ignore"):
        surface = as_surface((vertices, -vertices / np.linalg.norm(vertices, axis=1, keepdims=True)))
        pixel = seen(camera, surface).pixel
    assert pixel.min() >= 0
    assert pixel.max() < 8 * 10


def test_beyond_the_fold_of_a_barrel_nothing_is_seen():
    """The polynomial maps x/z = 1.66 to 0.29: into the image, although it is far outside the field of view."""
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, Lens(np.array([-0.3])))
    assert 0 < camera.project(np.array([1.66, 0, 1]))[0] < 64
    vertices = np.array([[1.66, 0, 1], [0.29, 0, 1]])
    pixel = seen(camera, as_surface((vertices, -vertices))).pixel[0]
    assert pixel[0] == 0
    assert pixel[1] > 0


def test_the_image_ends_half_a_pixel_beyond_its_outer_centres():
    camera = Camera(4, 3, 100.0, 100.0, 0.0, 0.0)
    columns = np.array([-0.51, -0.49, 0.49, 0.51, 3.49, 3.51, 40.0])
    vertices = np.column_stack([columns / 100, np.zeros(7), np.ones(7)])
    surface = as_surface((vertices, np.tile([0, 0, -1.0], (7, 1))))
    assert seen(camera, surface).pixel[0].tolist() == [0, 7, 7, 8, 10, 0, 0]


@given(seeds)
def test_vertices_that_face_away_or_lie_behind_the_mesh_are_hidden(seed):
    generator, count, center = np.random.default_rng(seed), 50, np.array([0.1, 0.2, -0.1])
    vertices, normals = generator.standard_normal((2, 3, count)).astype(np.float32)
    distance = generator.uniform(0.5, 1, count).astype(np.float32)
    front = (distance + generator.uniform(-2, 2, count) * HIDING_M).astype(np.float32)
    pixel, hidden = generator.integers(-1, 3, count).astype(np.int32), np.empty(count, np.bool_)
    hide(vertices, normals, center, front, distance, pixel, hidden)
    facing = np.sum(normals * (vertices - center[:, None]), axis=0) < 0
    np.testing.assert_array_equal(hidden, ~facing | ((pixel > 0) & (front < distance - np.float32(HIDING_M))))
