"""Colours out of a mosaic: exact where the scene is linear, alike in all four orders, sharp where hues are."""

import cv2
import numpy as np
import pytest

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage
from abs_service.tracker.terms.photometric.demosaicing import demosaiced
from drivers.simulated.sensors.bayer import Mosaic

COLUMNS, ROWS = np.meshgrid(np.arange(40.0), np.arange(30.0))
RAMPS = np.stack([3 * COLUMNS, 4 * ROWS, 200 - 2 * COLUMNS - 3 * ROWS], axis=-1).astype(np.float32)


def through(order: str, colors: np.ndarray) -> np.ndarray:
    """The colours that are found in the mosaic that the simulator makes of colours."""
    values = Mosaic(order).expose(colors.astype(np.float32))
    return demosaiced(values, ChannelImage(values, BAYER_ORDERS[order]).channel)


@pytest.mark.parametrize("order", BAYER_ORDERS)
def test_linear_colors_are_found_exactly_in_every_order(order):
    np.testing.assert_allclose(through(order, RAMPS)[2:-2, 2:-2], RAMPS[2:-2, 2:-2], atol=1e-3)


@pytest.mark.parametrize("order", BAYER_ORDERS)
def test_what_a_pixel_measured_stays_and_a_level_scene_is_level_up_to_its_border(order):
    level = np.full((12, 14, 3), (200, 100, 20), np.float32)
    np.testing.assert_allclose(through(order, level), level, atol=1e-3)
    noise = np.random.default_rng(1).uniform(0, 255, (12, 14, 3)).astype(np.float32)
    image = ChannelImage(Mosaic(order).expose(noise), BAYER_ORDERS[order])
    found = demosaiced(image.values, image.channel)
    own = np.take_along_axis(found, image.channel[..., None].astype(int), axis=2)[..., 0]
    np.testing.assert_array_equal(own, image.values)


@pytest.mark.parametrize("order", BAYER_ORDERS)
def test_fine_print_is_found_better_than_by_interpolating_each_channel_alone(order):
    noise = np.random.default_rng(2).standard_normal((120, 160)).astype(np.float32)
    print_ = 120 + 60 * cv2.GaussianBlur(noise, (0, 0), 0.8) / 0.35
    grey = np.repeat(np.clip(print_, 0, 255)[..., None], 3, axis=2).astype(np.uint8)
    mosaic = np.rint(Mosaic(order).expose(grey.astype(np.float32))).astype(np.uint8)
    # OpenCV calls an order by the second row's second and third pixel.
    code = {"rggb": "BayerBG", "bggr": "BayerRG", "grbg": "BayerGB", "gbrg": "BayerGR"}[order]
    bilinear = cv2.demosaicing(mosaic, getattr(cv2, f"COLOR_{code}2RGB"))
    error, bilinear_error = (
        np.std(found[3:-3, 3:-3] - grey[3:-3, 3:-3].astype(float)) for found in (through(order, grey), bilinear)
    )
    assert error < 0.6 * bilinear_error
