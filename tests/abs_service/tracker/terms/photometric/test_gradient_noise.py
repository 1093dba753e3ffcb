"""The noise of an image is no print: what it adds to the gradients is taken away."""

import numpy as np
import pytest

from abs_service.tracker.terms.gradients import color_rows, noise_deviation, noiseless_color_rows
from calib.camera import Camera

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
COLUMNS, ROWS = np.meshgrid(np.arange(160.0), np.arange(120.0))
PLACES = np.stack(np.meshgrid(np.linspace(10, 149, 25), np.linspace(10, 109, 20)), axis=-1).reshape(-1, 2)
VERTICES = CAMERA.directions(PLACES)  # a metre away


def picture(print_levels: float, noise: float, seed: int = 3) -> np.ndarray:
    """Smooth waves of a period of 20 pixels on a shaded ground, with noise, in levels (height, width, 3)."""
    waves = np.sin(COLUMNS * 2 * np.pi / 20) * np.cos(ROWS * 2 * np.pi / 20)
    grey = 120 + 0.1 * COLUMNS + 0.05 * ROWS + print_levels * waves
    generator = np.random.default_rng(seed)
    return (grey[..., None] + noise * generator.standard_normal((120, 160, 3))).astype(np.float32)


def length(image: np.ndarray, corrected: bool = True) -> float:
    """Root mean square of the rows."""
    weight = np.full((len(VERTICES), 3), 0.2)
    whole = color_rows(image, CAMERA, VERTICES) * weight[..., None]
    rows = noiseless_color_rows(image, CAMERA, VERTICES, weight) if corrected else whole
    return float(np.sqrt(np.mean(rows**2)))


@pytest.mark.parametrize("noise", [1.0, 3.0, 10.0])
def test_the_deviation_of_the_noise_is_found_on_a_ground_and_on_a_print(noise):
    for levels in (0.0, 40.0):
        np.testing.assert_allclose(noise_deviation(picture(levels, noise), PLACES), noise, rtol=0.25)


def test_an_image_of_which_nothing_is_known_has_no_noise():
    image = np.full((120, 160, 3), np.nan, np.float32)
    np.testing.assert_array_equal(noise_deviation(image, PLACES), 0)


@pytest.mark.parametrize("noise", [1.0, 3.0, 10.0])
def test_noise_on_a_blank_ground_holds_nothing(noise):
    """Regression: the more noise, the surer a wall without print was said to be tracked."""
    assert length(picture(0, noise)) < 0.5 * length(picture(0, noise), corrected=False)


def test_a_print_keeps_what_it_has_without_noise():
    clean = length(picture(40, 0), corrected=False)
    assert length(picture(40, 0)) == pytest.approx(clean, rel=0.01)
    for seed in range(5):
        assert length(picture(40, 3, seed)) == pytest.approx(clean, rel=0.05)
    assert length(picture(40, 10), corrected=False) > 1.05 * clean
    assert length(picture(40, 10)) == pytest.approx(clean, rel=0.05)
