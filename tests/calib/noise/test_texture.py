"""The texture that the likelihood kernel reads says what eq. 18 says, and uniform where there is nothing to say."""

import numpy as np
import pytest

from calib.noise.base import log_density, subtract_mean_offset
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.structured_light import StructuredLight
from calib.noise.texture import normalizers
from calib.noise.tof_amplitude import TofAmplitude
from drivers.simulated.sensors.time_of_flight import SIGMA_POLYNOMIAL
from tests.calib.noise.texels import negative_log_density, render_texture

#: The simulated time-of-flight head's law, the same with a mean offset that depends on both, and a Kinect's.
TOF = GaussianPolynomial(SIGMA_POLYNOMIAL, amplitudes=(400.0, 10_000.0))
BIASED = GaussianPolynomial(SIGMA_POLYNOMIAL, ((0.10, 2e-6), (-0.02, 0.0)), amplitudes=(400.0, 10_000.0))
LAW = TofAmplitude((0.0015, 0.0005), 9.0)
MODELS = {"tof": TOF, "biased": BIASED, "structured_light": StructuredLight(), "law": LAW}
UNIFORM = 1.6


@pytest.mark.parametrize(
    ("name", "allowed"), [("tof", 1e-5), ("law", 3e-3), ("biased", 2e-4), ("structured_light", 1e-3)]
)
@pytest.mark.parametrize("distance", [0.7, 1.0, 1.6, 3.0])
def test_it_is_eq_18_within_three_deviations(name, allowed, distance):
    """In units of the log-density itself, whose difference between 0 and 3 deviations is 4.5."""
    model = MODELS[name]
    amplitude = np.array([[500.0, 3000.0, 9000.0]], np.float32)
    p = (np.zeros(3, int), np.arange(3))
    texels = render_texture(model, np.full((1, 3), distance, np.float32), amplitude, UNIFORM)[1, 1:4]
    measured, a = np.full(3, np.float32(distance), float), amplitude[0].astype(float)
    middle, sigma = measured - model.mean(measured, a, p), model.deviation(measured, a, p)
    for z in np.linspace(-3, 3, 25):
        x = middle + z * sigma
        exact = -log_density(model, measured, x, a, p)
        rendered = np.diagonal(negative_log_density(texels, texels[:, 0] - x))
        np.testing.assert_allclose(rendered, exact, atol=allowed)


@pytest.mark.parametrize("name", MODELS)
def test_normalizers_of_single_pixels_are_those_of_the_texture(name):
    distance, amplitude = np.array([[0.7, 1.6, 3.0]], np.float32), np.array([[500.0, 3000.0, 9000.0]], np.float32)
    p = (np.zeros(3, int), np.arange(3))
    found = normalizers(MODELS[name], distance[0].astype(float), amplitude[0].astype(float), p)
    np.testing.assert_array_equal(found, render_texture(MODELS[name], distance, amplitude, UNIFORM)[1, 1:4, 6])


def test_where_nothing_returned_and_around_the_image_it_is_uniform():
    distance = np.array([[1.0, np.nan, 0.0], [np.inf, -1.0, 2.0]], np.float32)
    texture = render_texture(TOF, distance, np.full((2, 3), 3000, np.float32), UNIFORM)
    assert texture.shape == (4, 5, 8)
    assert texture.dtype == np.float32
    measured = np.zeros((4, 5), bool)
    measured[1, 1] = measured[2, 3] = True
    np.testing.assert_array_equal(texture[..., 3] > 0, measured)
    silent = texture[~measured]
    np.testing.assert_array_equal(silent, np.tile(np.array([0, 0, 0, 0, 0, 0, UNIFORM, 0], np.float32), (18, 1)))
    np.testing.assert_allclose(negative_log_density(silent, [-3.0, 0.0, 3.0]), UNIFORM, rtol=1e-7)


def test_a_large_image_is_rendered_in_blocks_that_leave_no_seam():
    """Rows of the two images are the same; the large one has more pixels than are rendered at once."""
    row = np.linspace(0.7, 3.0, 600, dtype=np.float32)
    row[::7] = np.nan
    amplitude = np.linspace(500, 9000, 600, dtype=np.float32)
    large = render_texture(BIASED, np.tile(row, (130, 1)), np.tile(amplitude, (130, 1)), UNIFORM)
    small = render_texture(BIASED, row[None], amplitude[None], UNIFORM)
    np.testing.assert_array_equal(large[1:-1], np.tile(small[1:2], (130, 1, 1)))


def test_infinite_distances_are_no_returns_for_every_model():
    distance = np.full((2, 2), np.inf, np.float32)
    for model in MODELS.values():
        assert np.isfinite(render_texture(model, distance, np.ones_like(distance), UNIFORM)).all()


def test_a_pixel_without_an_amplitude_cannot_be_judged_by_a_model_that_needs_one():
    amplitude = np.array([[np.nan, 3000.0]], np.float32)
    distance = np.ones((1, 2), np.float32)
    assert (render_texture(TOF, distance, amplitude, UNIFORM)[1, 1:3, 3] > 0).tolist() == [False, True]
    assert (render_texture(StructuredLight(), distance, amplitude, UNIFORM)[1, 1:3, 3] > 0).all()


def test_beyond_the_window_the_density_still_falls():
    texels = render_texture(TOF, np.ones((1, 1), np.float32), np.full((1, 1), 3000, np.float32), UNIFORM)[1, 1:2]
    cost = negative_log_density(texels, np.linspace(0, 2, 201))[0]
    assert np.all(np.diff(cost) > 0)


def test_the_mean_offset_can_be_taken_out_of_an_image():
    distance, amplitude = np.array([[1.0, np.nan, 2.0]], np.float32), np.array([[3000.0, 3000.0, 500.0]], np.float32)
    offsets = [0.10 - 0.02 * 1 + 2e-6 * 3000, np.nan, 0.10 - 0.02 * 2 + 2e-6 * 500]
    np.testing.assert_allclose(
        subtract_mean_offset(BIASED, distance, amplitude), distance - np.array([offsets]), rtol=1e-6
    )
