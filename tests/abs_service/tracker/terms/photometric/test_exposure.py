"""Gains of images, and what a term makes of an image that is darker than the appearance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ONE_CHANNEL, ChannelImage
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.terms.base import Prediction
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.exposure import BRIGHTEST, DARKEST, find_ratios, gains
from abs_service.tracker.terms.photometric.illumination import Exposed, Passive
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.grey import GaussianGrey
from calib.rig import Sensor
from tests import reference
from tests.abs_service.tracker.scenes import CAMERA, as_surface, sparse
from tests.abs_service.tracker.synthesis.random_vertices import decided

GENERATOR_SEED = 5


def _appearance() -> np.ndarray:
    return np.random.default_rng(GENERATOR_SEED).uniform(40, 200, (300, 3))


def test_the_gain_of_every_channel_is_found_through_noise_an_occluder_and_unknown_values():
    generator, expected = np.random.default_rng(GENERATOR_SEED), _appearance()
    true = np.array([0.7, 0.8, 1.2])
    measured = expected * true + generator.normal(0, 4, expected.shape)
    measured[:100] = 90.0  # a hand
    expected[100:130] = np.nan
    assert gains(measured, expected) == pytest.approx(true, rel=0.05)


def test_a_print_that_is_exchanged_has_no_gain():
    expected = _appearance()
    assert gains(np.roll(expected, 7, axis=0), expected) == pytest.approx(np.ones(3), abs=0.12)


@pytest.mark.parametrize("measured", [np.full((300, 3), np.nan), np.full((300, 3), 255.0), np.full((300, 3), 3.0)])
def test_unknown_saturated_and_black_values_show_no_gain(measured: np.ndarray):
    assert gains(measured, _appearance()).tolist() == [1, 1, 1]


def test_too_few_samples_show_no_gain():
    expected = _appearance()[:30]
    assert gains(expected * 0.5, expected).tolist() == [1, 1, 1]


def test_a_channel_with_too_few_samples_has_the_gain_of_all():
    expected = _appearance()
    expected[40:, 0] = 5.0  # hardly any red
    assert gains(expected * 0.6, expected) == pytest.approx([0.6] * 3)


def test_gains_beyond_a_white_balance_are_another_thing_and_do_not_make_it_look_like_the_object():
    ball, hand = np.full((300, 3), (60.0, 120.0, 55.0)), np.full((300, 3), (180.0, 140.0, 120.0))
    found = gains(hand, ball)
    assert np.ptp(found) == 0, "exposure at most, which all channels have in common"
    assert np.abs(ball * found - hand).max(axis=1).min() > 60


@pytest.mark.parametrize(("light", "remains"), [(Exposed(), False), (Passive(), True)])
@pytest.mark.parametrize("pattern", [ONE_CHANNEL, BAYER_ORDERS["grbg"]], ids=["grey", "bayer"])
def test_a_darker_image_of_one_value_per_pixel_costs_no_more_where_exposure_adapts(pattern, light, remains):
    generator = np.random.default_rng(GENERATOR_SEED)
    vertices, normals = decided(generator, 600)
    surface = as_surface((vertices, normals))
    looks = generator.uniform(60, 200, (len(vertices), int(pattern.max()) + 1)).astype(np.float32)
    noise = GaussianGrey(6.0) if pattern is ONE_CHANNEL else GaussianBayer(6.0)
    bounds = likelihood.Settings().bounds(Sensor("color", CAMERA, noise))
    costs = []
    for exposure in (1.0, 0.6):
        term = ChannelTerm("color", sparse(CAMERA), looks, noise, light, bounds)
        image = ChannelImage(np.full((CAMERA.height, CAMERA.width), np.nan, np.float32), pattern)
        for vertex, normal, look in zip(vertices.astype(float), normals, looks, strict=True):
            pixel = reference.seen_pixel(CAMERA, vertex, normal)
            if pixel is not None:
                image.values[pixel] = exposure * look[image.channel[pixel]]
        term = term.observe(image, Prediction(surface))
        costs.append(float(term.cost(surface)[0]))
    assert (costs[1] > costs[0] + 100) == remains
    assert remains or costs[1] == pytest.approx(costs[0], abs=1.0)


@given(st.integers(0, 2**32 - 1))
def test_ratios_are_those_of_values_that_are_neither_noise_nor_saturated(seed: int):
    generator = np.random.default_rng(seed)
    measured, expected = generator.uniform(0, 300, (2, 20, 3))
    measured[generator.random((20, 3)) < 0.2] = np.nan
    ratios, count = np.full((3, 20), np.nan), np.zeros(4, np.int64)
    find_ratios(measured, expected, ratios, count)
    usable = (np.fmin(measured, expected) > DARKEST) & (np.fmax(measured, expected) < BRIGHTEST) & (measured > 0)
    assert count.tolist() == [*usable.sum(axis=0), usable.any(axis=1).sum()]
    for channel, chosen in enumerate(usable.T):
        np.testing.assert_allclose(ratios[channel, : count[channel]], (measured / expected)[chosen, channel])
