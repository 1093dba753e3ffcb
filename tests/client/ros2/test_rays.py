"""Rays of the client's cameras, compared with those of the service."""

from dataclasses import replace

import numpy as np
import pytest
from abs_client.camera import Camera
from abs_client.ros2.rays import axial_shares
from absmsg.v1.sensor_model_pb2 import SensorModel

from calib.lenses.by_name import lens_of
from calib.lenses.lookup import build

SIZE = 64, 48
MATRIX = 60.0, 62.0, 30.0, 25.0
K = np.array([[60.0, 0, 30], [0, 62, 25], [0, 0, 1]])
LENSES = {
    "brown_conrady": (0.1, -0.05, 0.002, -0.001, 0.01, 0.02, -0.01, 0.003),
    "fisheye": (0.05, -0.01, 0.002, -0.0005),
}


def camera(model, lens):
    return Camera(*SIZE, K, lens, model, np.eye(4), SensorModel())


@pytest.mark.parametrize("model", LENSES)
def test_a_lens_is_undone(model):
    lens = LENSES[model]
    wanted = 1 / build(SIZE, MATRIX, lens_of(model, lens)).ray_length
    np.testing.assert_allclose(axial_shares(camera(model, lens), True), wanted, atol=1e-5)


def test_a_fisheye_without_coefficients_is_equidistant():
    wanted = 1 / build(SIZE, MATRIX, lens_of("fisheye", ())).ray_length
    np.testing.assert_allclose(axial_shares(camera("fisheye", ()), True), wanted, atol=1e-5)
    assert wanted[0, 0] < axial_shares(camera("brown_conrady", ()), True)[0, 0] - 0.02


def test_images_without_distortion_have_the_rays_of_a_pinhole():
    with_lens = camera("brown_conrady", LENSES["brown_conrady"])
    wanted = axial_shares(replace(with_lens, lens=()), True)
    np.testing.assert_array_equal(axial_shares(with_lens, False), wanted)
    assert wanted[25, 30] == 1.0


def test_a_pixel_beyond_the_field_of_the_lens_has_no_ray():
    folded = axial_shares(camera("brown_conrady", (-3.0, 0.0, 0.0, 0.0, 0.0)), True)
    assert np.isnan(folded[0, 0])
    assert np.isfinite(folded[25, 30])
