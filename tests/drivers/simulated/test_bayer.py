"""The Bayer head: filter patterns, crosstalk and fine prints."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from calib.camera import Camera
from drivers.simulated.address import parse
from drivers.simulated.sensors.bayer import ORDERS, Bayer, Mosaic
from drivers.simulated.sensors.color import Color, Picture
from drivers.simulated.sensors.exposure import Exposure
from drivers.simulated.simulation import Simulation


def build(query: str) -> Simulation:
    return parse(f"simulated://sheet?{query}").build()


@pytest.mark.parametrize("order", ORDERS)
def test_the_mosaic_is_one_channel_per_pixel_of_the_colour_image(order: str) -> None:
    simulation = build("sensors=color")
    picture = Picture(simulation.heads["color"].camera, simulation.scene)  # two sensors behind one lens
    heads = Color("color", picture, 30, sigma=0), Bayer("bayer", picture, 30, sigma=0, mosaic=Mosaic(order))
    exposure = Exposure(100, simulation.scene.at(3.3), np.random.default_rng(0), 0)
    (color,), (bayer,) = (head.expose(exposure) for head in heads)
    rgb, mosaic = color.data, bayer.data
    assert bayer.encoding == f"bayer_{order}8"
    for row in range(2):
        for column in range(2):
            channel = {"r": 0, "g": 1, "b": 2}[order[2 * row + column]]
            np.testing.assert_array_equal(mosaic[row::2, column::2], rgb[row::2, column::2, channel])


def test_the_default_order_is_grbg() -> None:
    assert build("sensors=bayer").heads["bayer"].streams[0].encoding == "bayer_grbg8"


@given(st.sampled_from(ORDERS), st.floats(0, 0.5), st.tuples(*[st.floats(0, 255)] * 3))
def test_crosstalk_mixes_the_channels_as_declared(order: str, c: float, color: tuple[float, float, float]) -> None:
    mosaic = Mosaic(order, crosstalk=c).expose(np.full((6, 8, 3), color, np.float32))
    r, g, b = color
    mixed = {"r": (1 - c) * r + c * g, "g": (1 - c) * g + c * (r + b) / 2, "b": (1 - c) * b + c * g}
    for place, letter in enumerate(order):
        np.testing.assert_allclose(mosaic[place // 2 :: 2, place % 2 :: 2], mixed[letter], atol=1e-3)


def test_the_fine_print_has_details_of_one_to_three_pixels() -> None:
    widths = {}
    for texture in ("smooth", "fine"):
        frames, _ = build(f"sensors=color&color=640x480&noise=0&texture={texture}").expose(0)
        print_ = frames[0].data[200:280, 230:350].astype(float).mean(axis=-1)
        detail = print_ - gaussian_filter(print_, 5)
        assert np.std(print_) > 30
        widths[texture] = detail.shape[1] / np.mean(np.count_nonzero(np.diff(np.sign(detail), axis=1), axis=1))
    assert 1.5 < widths["fine"] < 3.5 < widths["smooth"]


def test_a_pixel_of_a_fine_print_is_the_mean_over_its_area() -> None:
    simulation = build("texture=fine&sensors=color")
    camera, moment = Camera(96, 72, 275.0, 275.0, 47.5, 35.5), simulation.scene.at(3.0)
    dense = Picture(camera, simulation.scene, samples=12).take(moment)
    errors = [np.abs(Picture(camera, simulation.scene, n).take(moment) - dense).mean() for n in (1, 2, 4)]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_the_colour_head_takes_two_rays_per_pixel_and_axis_of_a_fine_print() -> None:
    simulation = build("texture=fine&sensors=color&noise=0")
    (frame,) = simulation.frames(0)
    levels = Picture(simulation.heads["color"].camera, simulation.scene, samples=2).take(simulation.scene.at(0.0))
    assert np.abs(frame.data.astype(np.float32) - levels).max() <= 0.501
