"""Depth images as z and as points: the pixels' own lines of sight, by plain NumPy."""

import numpy as np
import pytest

from abs_service.pairing.observation import ObservationError
from abs_service.pairing.points import points_s, z_image
from calib.camera import Camera
from calib.lenses.lens import Lens
from drivers.contract.frame import Frame, Geometry, Kind

CAMERA = Camera(40, 30, 35.0, 36.0, 19.2, 14.7)
DISTORTED = Camera(40, 30, 35.0, 36.0, 19.2, 14.7, Lens(np.array([-0.1, 0.02, 0.001, -0.002, 0, 0, 0, 0])))


def frame(values, geometry, scale=0.001):
    data = np.asarray(values, "<u2")
    return Frame("tof", "depth", Kind.DEPTH, data, "16UC1", 0, 0, 0, scale=scale, geometry=geometry, invalid=0)


@pytest.fixture
def steps():
    steps = np.random.default_rng(1).integers(500, 4000, (30, 40))
    steps[3, 4] = 0
    return steps


def test_points_are_on_the_pixels_line_of_sight_at_the_radial_distance(steps):
    v, u = np.mgrid[:30, :40]
    direction = np.stack([(u - 19.2) / 35.0, (v - 14.7) / 36.0, np.ones((30, 40))], axis=-1)
    expected = direction / np.linalg.norm(direction, axis=-1, keepdims=True) * (0.0003 * steps)[..., None]
    expected[3, 4] = np.nan
    found = points_s(z_image(frame(steps, Geometry.RADIAL, scale=0.0003), CAMERA), CAMERA)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_z_is_the_third_coordinate(steps):
    found = points_s(z_image(frame(steps, Geometry.Z), CAMERA), CAMERA)
    expected = 0.001 * steps
    expected[3, 4] = np.nan
    np.testing.assert_allclose(found[..., 2], expected, rtol=1e-6)


@pytest.mark.parametrize("geometry", [Geometry.Z, Geometry.RADIAL])
def test_points_of_a_distorted_image_are_seen_where_they_were(steps, geometry):
    found = points_s(z_image(frame(steps, geometry), DISTORTED), DISTORTED)
    v, u = np.mgrid[:30, :40].astype(float)
    known = steps > 0
    np.testing.assert_allclose(DISTORTED.project(found[known]), np.stack([u, v], -1)[known], atol=2e-3)
    length = found[..., 2] if geometry == Geometry.Z else np.linalg.norm(found, axis=-1)
    np.testing.assert_allclose(length[known], 0.001 * steps[known], rtol=1e-6)


def test_an_image_of_another_size_is_refused(steps):
    with pytest.raises(ObservationError, match="40 × 29"):
        z_image(frame(steps[1:], Geometry.Z), CAMERA)
