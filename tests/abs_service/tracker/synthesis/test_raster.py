"""The distance image of a mesh, whole and at single pixels."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.synthesis.rasterization.raster import Raster
from calib.camera import Camera
from calib.lenses.lens import Lens
from tests.abs_service.tracker.scenes import flat, sheet

CAMERA = Camera(80, 60, 150.0, 150.0, 39.5, 29.5, Lens(np.array([-0.15, 0.03, 1e-3, -1e-3])))
MESH = sheet(9, 13, flat)


@given(st.integers(0, 2**32 - 1), st.integers(0, 300))
def test_single_pixels_have_the_distances_of_the_whole_image(seed, count):
    generator = np.random.default_rng(seed)
    vertices = (MESH.vertices + generator.normal(size=MESH.vertices.shape) * 0.02).T.astype(np.float32)
    vertices[:, generator.integers(vertices.shape[1])] *= -1  # behind the camera
    rows, columns = generator.integers(CAMERA.height, size=count), generator.integers(CAMERA.width, size=count)
    raster = Raster(CAMERA, MESH.faces)
    found = raster.render_at(vertices, rows, columns)
    np.testing.assert_allclose(found, raster.render(vertices)[rows, columns], rtol=1e-6)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_a_pixel_has_the_nearest_face_that_covers_its_centre(seed):
    """Corners are projected; between them, 1/z is linear in the image."""
    generator = np.random.default_rng(seed)
    vertices = (MESH.vertices + generator.normal(size=MESH.vertices.shape) * 0.02).astype(np.float32)
    places, near = CAMERA.project(vertices), 1 / (vertices - CAMERA.center)[:, 2]
    image = np.zeros((CAMERA.height, CAMERA.width))
    centers = np.stack(np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height)), axis=-1)
    for face in MESH.faces:
        corners = np.column_stack([places[face], np.ones(3)])
        weights = np.dstack([centers, np.ones(image.shape)]) @ np.linalg.inv(corners)
        image = np.maximum(image, np.where((weights >= 0).all(axis=-1), weights @ near[face], 0))
    with np.errstate(divide="ignore"):
        expected = CAMERA.lookup.ray_length / image
    found = Raster(CAMERA, MESH.faces).render(vertices.T.copy())
    covered = np.isfinite(found) & np.isfinite(expected)
    assert np.count_nonzero(np.isfinite(found) ^ np.isfinite(expected)) < 5  # a centre on an edge, but for rounding
    assert np.count_nonzero(np.abs(found[covered] - expected[covered]) > 1e-4) < 5
