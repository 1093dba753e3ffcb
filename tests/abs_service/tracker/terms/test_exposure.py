"""Gains of colour images, and what a term makes of an image that is darker than the appearance."""

import numpy as np
import pytest

from abs_service.tracker.terms.photometric.exposure import gains

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
