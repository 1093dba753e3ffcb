"""Margins of depth images without return, and sensors whose images end at them."""

import numpy as np
import pytest

from abs_service.pairing.images import DepthImage
from abs_service.tracker.field_of_view import FieldOfView, filled
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.constant import Constant
from calib.noise.per_pixel import PerPixel
from calib.rig import Rig, Sensor

HEIGHT, WIDTH = 120, 160


def returns(left=0, right=0, top=0, bottom=0):
    image = np.zeros((HEIGHT, WIDTH), np.bool_)
    image[top : HEIGHT - bottom, left : WIDTH - right] = True
    return image


def test_an_image_that_is_full_has_no_margin():
    assert filled(returns()) is None


@pytest.mark.parametrize(("sides", "rows", "columns"), [
    ({"right": 2}, (0, 120), (0, 158)),
    ({"left": 10, "top": 3}, (3, 120), (10, 160)),
    ({"left": 1, "right": 2, "top": 3, "bottom": 4}, (3, 116), (1, 158)),
])  # fmt: skip
def test_margins_are_left_out(sides, rows, columns):
    assert filled(returns(**sides)) == (slice(*rows), slice(*columns))


def test_more_than_a_margin_is_a_background():
    assert filled(returns(right=20)) is None


def test_an_object_of_less_than_half_the_height_before_nothing_has_no_margin_beside_it():
    image = np.zeros((HEIGHT, WIDTH), np.bool_)
    image[40:95, 5:100] = True
    assert filled(image) is None


def test_single_returns_in_a_margin_and_missing_ones_behind_it_change_nothing():
    image = returns(right=4) & (np.random.default_rng(1).random((HEIGHT, WIDTH)) < 0.7)
    image[60, -1] = True
    assert filled(image) == (slice(0, HEIGHT), slice(0, WIDTH - 4))


def test_the_end_of_a_margin_may_be_curved():
    image = returns()
    for row in range(HEIGHT):
        image[row, WIDTH - 6 - round(4 * (row / HEIGHT - 0.5) ** 2 * 4) :] = False
    window = filled(image)
    assert window is not None
    assert WIDTH - 10 <= window[1].stop <= WIDTH - 6


def test_a_rig_and_its_images_are_cropped_alike():
    camera = Camera(WIDTH, HEIGHT, 150.0, 150.0, 79.5, 59.5)
    scales = np.linspace(1, 2, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)
    noise = PerPixel(Constant(0.002), 1e-3 * scales[None], scales, np.array([0.5, 2.0]))
    rig = Rig("r", {"tof": Sensor("tof", camera, noise), "other": Sensor("other", camera, Constant(0.01))})
    distance = np.where(returns(left=5, top=3), np.arange(1.0, HEIGHT * WIDTH + 1).reshape(HEIGHT, WIDTH), np.nan)
    image = DepthImage(distance.astype(np.float32), distance.astype(np.float32))
    field = FieldOfView.of({"tof": image})
    tof = field.of_rig(rig).sensors["tof"]
    assert (tof.camera.width, tof.camera.height) == (WIDTH - 5, HEIGHT - 3)
    assert field.of_rig(rig).sensors["other"] == rig.sensors["other"]
    point = np.array([0.1, -0.05, 1.0])
    np.testing.assert_allclose(tof.camera.project(point), camera.project(point) - [5, 3])
    part = image.cropped(field.windows["tof"])
    np.testing.assert_array_equal(part.distance, image.distance[3:, 5:])
    inner, amplitude = part.within((slice(10, 20), slice(30, 50)))
    np.testing.assert_array_equal(inner, image.distance[13:23, 35:55])
    np.testing.assert_array_equal(amplitude, inner)
    assert isinstance(tof.noise, DepthNoise)
    ones, rows, columns = np.ones(2), np.array([7, 90]), np.array([11, 120])
    here, there = (rows, columns), (rows + 3, columns + 5)
    np.testing.assert_array_equal(tof.noise.deviation(ones, ones, here), noise.deviation(ones, ones, there))
    np.testing.assert_array_equal(tof.noise.mean(ones, ones, here), noise.mean(ones, ones, there))
