"""Colours that two surfaces have in common."""

import numpy as np
import pytest

from abs_service.tracking.monitors.common_colors import common_share

GENERATOR = np.random.default_rng(1)
WOOD, SKIN, GREY = (np.array(color, float) for color in ((150, 110, 70), (200, 150, 120), (120, 120, 120)))


def surface(*colors: np.ndarray, count: int = 300, noise: float = 3.0) -> np.ndarray:
    """Values (count, channels) of a surface that has these colours in equal shares, in no order."""
    return GENERATOR.permutation(np.resize(colors, (count, len(colors[0])))) + GENERATOR.normal(0, noise, (count, 1))


@pytest.mark.parametrize("gain", [0.3, 0.7, 1.0, 1.6])
def test_an_exposure_changes_nothing(gain):
    assert common_share(gain * surface(WOOD, GREY), surface(WOOD, GREY)) > 0.8


def test_other_colors_of_the_same_brightness_are_told_apart():
    blue = np.array([60.0, 120.0, 180.0])
    assert common_share(surface(blue), surface(GREY)) < 0.1
    assert common_share(surface(WOOD), surface(GREY)) < 0.3


def test_a_part_of_one_colour_shares_what_that_covers_of_the_whole():
    assert common_share(surface(SKIN), surface(SKIN, SKIN, GREY)) == pytest.approx(2 / 3, abs=0.1)


def test_of_one_channel_the_contrast_tells():
    dark, bright = np.array([30.0]), np.array([220.0])
    assert common_share(2 * surface(dark, bright), surface(dark, bright)) > 0.8
    assert common_share(surface(bright), surface(dark, bright)) < 0.6


def test_more_than_an_exposure_is_another_surface():
    assert common_share(surface(np.array([15.0]), noise=1), surface(np.array([220.0]))) < 0.1


@pytest.mark.parametrize("count", [25, 60, 300])
def test_few_values_of_a_colorful_print_are_not_told_apart_by_chance(count):
    first, second = (GENERATOR.uniform(20, 240, (count, 3)) for _ in range(2))
    assert common_share(first, second) > 0.8


def test_what_is_unknown_is_not_compared():
    unknown = np.full((300, 3), np.nan)
    assert common_share(unknown, surface(GREY)) == common_share(surface(GREY), unknown) == 1
    assert common_share(np.zeros((30, 3)), np.zeros((30, 3))) == pytest.approx(1)
