"""Noise of pictures and light barriers: deviations, and fits that find the simulator's laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.noise.base import LEVELS, NoiseError
from calib.noise.fit import image_noise
from calib.noise.images import bayer, binary, color, grey, intensity
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.binary import LightBarrier
from calib.noise.images.color import GaussianColor
from calib.noise.images.grey import GaussianGrey
from calib.noise.images.intensity import GaussianIntensity
from drivers.simulated.address import parse
from tests import reference

SIGMAS, SEEDS = st.floats(0.5, 40), st.integers(0, 2**32 - 1)
RATES = st.floats(1e-3, 0.49)
MODELS = st.one_of(
    st.builds(GaussianColor, SIGMAS),
    st.builds(GaussianGrey, SIGMAS),
    st.builds(GaussianBayer, SIGMAS),
    st.builds(GaussianIntensity, st.just("ir"), SIGMAS, st.floats(0, 0.3)),
)
BARRIERS = st.builds(LightBarrier, st.just(0.8), RATES, RATES)
#: What pixels of a picture look like without noise: neither black nor white.
REAL = st.floats(20, 235)
CROSSTALK = ((0.8, 0.15, 0.05), (0.1, 0.8, 0.1), (0.0, 0.2, 0.8))
FITS = {"color": color.fit, "grey": grey.fit, "bayer": bayer.fit}


def exposures(query: str, stream: str, number: int) -> np.ndarray:
    """Images (number, …) of a stream of the simulator at rest, in SI values."""
    simulation = parse(f"simulated://sheet?{query}").build()
    frames = [frame for k in range(number) for frame in simulation.expose(k)[0] if frame.stream == stream]
    return np.array([frame.si() if frame.data.ndim == 2 else frame.data for frame in frames], float)


@given(MODELS, REAL)
def test_the_deviation_is_that_of_the_formula(model, real):
    values = np.full((2, 3), real, np.float32)
    np.testing.assert_allclose(model.deviation(values), reference.picture_deviation(model, values), rtol=1e-5)


@given(st.floats(0, 0.15), REAL)
def test_taking_the_deviation_at_the_measured_value_changes_the_sum_as_documented(relative, real):
    """Once a frame instead of once a candidate; with 10 %, the tracker's density sums up to 1.01."""
    model = GaussianIntensity("ir", 1e-3 * real, relative)
    measured = np.linspace(0.2, 6, 20_001) * real
    spread = reference.picture_deviation(model, measured)
    density = np.exp(-0.5 * ((measured - real) / spread) ** 2) / (np.sqrt(2 * np.pi) * spread)
    assert np.trapezoid(density, measured) == pytest.approx(1 + relative**2, abs=4 * relative**4 + 1e-5)


@settings(max_examples=6)
@given(st.sampled_from(sorted(FITS)), st.floats(0.5, 25), SEEDS)
def test_one_deviation_is_found_again_whatever_outliers_there_are(name, sigma, seed):
    generator = np.random.default_rng(seed)
    real = generator.uniform(0, 255, (40, 50, 3))
    measured = real + sigma * generator.standard_normal(real.shape)
    lost = generator.random(real.shape) < 0.05
    measured[lost] = generator.uniform(0, LEVELS, lost.sum())
    measured[0] = np.nan
    assert FITS[name](measured, real).sigma == pytest.approx(sigma, rel=0.08)


@pytest.mark.parametrize(
    ("name", "query"),
    [("color", "sensors=color&noise=2"), ("bayer", "sensors=bayer&order=gbrg&noise=2"), ("grey", "sensors=bayer")],
)
def test_what_a_camera_errs_by_is_told_from_pictures_of_a_scene_that_rests(name, query):
    """The simulator's camera has 2.5 levels, times `noise`, and rounds to whole ones."""
    stream = "color" if name == "color" else "bayer"
    declared = 5.0 if "noise=2" in query else 2.5
    measured, real = image_noise.from_static_scene(exposures(query, stream, 8))
    assert FITS[name](measured, real).sigma == pytest.approx(np.hypot(declared, np.sqrt(1 / 12)), rel=0.02)


def test_two_pictures_are_enough():
    images = 100 + 3.0 * np.random.default_rng(1).standard_normal((2, 40_000))
    assert grey.fit(*image_noise.from_static_scene(images)).sigma == pytest.approx(3, rel=0.02)
    with pytest.raises(NoiseError, match="at least 2 pictures of a static scene, not 1"):
        image_noise.from_static_scene(images[:1])


def test_what_is_cut_off_at_black_or_white_does_not_count():
    images = np.clip(
        np.rint(np.array([2.0, 120.0, 254.0]) + 4 * np.random.default_rng(1).normal(size=(900, 3))), 0, 255
    )
    measured, real = image_noise.from_static_scene(images)
    assert np.isnan(measured[:, [0, 2]]).all()
    assert np.isnan(real[:, [0, 2]]).all()
    assert np.isfinite(measured[:, 1]).all()


@settings(max_examples=5)
@given(st.floats(5, 100), st.floats(0.02, 0.3), SEEDS)
def test_both_parts_of_an_intensity_s_deviation_are_found_again(sigma, relative, seed):
    generator = np.random.default_rng(seed)
    real = np.geomspace(10, 5000, 20_000)
    measured = real + np.hypot(sigma, relative * real) * generator.standard_normal(real.shape)
    lost = generator.random(real.shape) < 0.05
    measured[lost] = generator.uniform(0, 65535, lost.sum())
    found = intensity.fit(measured, real, "ir")
    assert found.relative == pytest.approx(relative, rel=0.1)
    law = GaussianIntensity("ir", sigma, relative)
    spread, known = (reference.picture_deviation(model, np.array([30.0, 5000.0])) for model in (found, law))
    np.testing.assert_allclose(spread, known, rtol=0.1)
    assert found.uniform == law.uniform


def test_the_infrared_noise_of_the_simulator_has_no_proportional_part():
    measured, real = image_noise.from_static_scene(exposures("sensors=ir&noise=2", "ir", 10), full_scale=65535)
    found = intensity.fit(measured, real, "ir")
    assert found.sigma == pytest.approx(100, rel=0.03)
    assert found.relative < 0.005


@pytest.mark.parametrize("dark", [0.0, 20.0])
def test_an_intensity_whose_brighter_pixels_err_less_is_still_a_model(dark):
    generator = np.random.default_rng(2)
    real = generator.uniform(100, 1000, 5000)
    measured = real + (dark + 1000 / np.sqrt(real)) * generator.standard_normal(5000)
    found = intensity.fit(measured, real, "ir")
    assert found.relative == 0
    assert found.sigma == pytest.approx(np.sqrt(np.mean((dark + 1000 / np.sqrt(real)) ** 2)), rel=0.05)
    proportional = intensity.fit(real * (1 + 0.1 * generator.standard_normal(5000)), real, "ir")
    assert proportional.relative == pytest.approx(0.1, rel=0.05)
    assert 0 < proportional.sigma < 20


@settings(max_examples=4)
@given(SEEDS)
def test_crosstalk_is_found_again_from_known_colors(seed):
    generator = np.random.default_rng(seed)
    colors, channel = generator.uniform(20, 235, (6000, 3)), generator.integers(0, 3, 6000)
    law = GaussianBayer(2.0, CROSSTALK)
    measured = np.take_along_axis(law.apply_crosstalk(colors), channel[:, None], axis=1)[:, 0]
    measured += 2 * generator.standard_normal(6000)
    lost = generator.random(6000) < 0.05
    measured[lost] = generator.uniform(0, 255, lost.sum())
    found = GaussianBayer(2.0, bayer.fit_crosstalk(measured, colors, channel))
    np.testing.assert_allclose(found.crosstalk, CROSSTALK, atol=0.01)


def test_colors_that_do_not_tell_the_filters_apart_are_no_reason_to_guess():
    greys, channel = np.tile(np.linspace(20, 235, 300)[:, None], 3), np.arange(300) % 3
    with pytest.raises(NoiseError, match="vary too little to tell 3 coefficients apart"):
        bayer.fit_crosstalk(greys[:, 0], greys, channel)
    with pytest.raises(NoiseError, match="no pixel lies behind a blue filter"):
        bayer.fit_crosstalk(greys[:, 0], greys, channel % 2)
    with pytest.raises(NoiseError, match="vary too little"):  # a chart without blue
        bayer.fit_crosstalk(greys[:, 0], np.column_stack([greys[:, 0], greys[::-1, 1], 0 * greys[:, 2]]), channel)


@pytest.mark.parametrize("fit", [*FITS.values(), lambda measured, real: intensity.fit(measured, real, "ir")])
def test_without_numbers_there_is_no_model(fit):
    with pytest.raises(NoiseError, match="none of 4 measured numbers comes with a real one"):
        fit(np.full(4, np.nan), np.ones(4))


def test_more_numbers_than_needed_are_thinned():
    residual, real = image_noise.residuals(np.ones(300_000), np.arange(300_000.0))
    assert len(residual) == 200_000
    np.testing.assert_array_equal(residual, 1 - real)


@given(BARRIERS, st.booleans(), st.booleans())
def test_the_probabilities_of_a_barrier_are_those_of_its_errors(model, interrupted, crossing):
    expected = {
        (True, True): 1 - model.miss,
        (False, True): model.miss,
        (True, False): model.false_alarm,
        (False, False): 1 - model.false_alarm,
    }
    assert np.exp(-model.cost(interrupted)[crossing]) == pytest.approx(expected[interrupted, crossing])


@settings(max_examples=15)
@given(BARRIERS, SEEDS)
def test_the_error_rates_of_a_barrier_are_found_again(model, seed):
    generator = np.random.default_rng(seed)
    crossing = generator.random(20_000) < 0.3
    readings = crossing ^ (generator.random(20_000) < np.where(crossing, model.miss, model.false_alarm))
    sizes = np.array([crossing.sum(), (~crossing).sum()])
    rates = np.array([model.miss, model.false_alarm])
    allowed = 5 * np.sqrt(rates * (1 - rates) / sizes) + 1 / sizes
    if rates.max() < 0.47:  # far enough from what `fit` refuses
        found = binary.fit(readings, crossing, 0.8)
        assert np.all(np.abs(np.array([found.miss, found.false_alarm]) - rates) < allowed)
        assert found.length_m == 0.8


def test_the_simulator_s_barrier_is_found_again():
    simulation = parse("simulated://sheet?sensors=barrier&seed=5&noise=10&speed=2").build()
    barrier = simulation.heads["barrier"]
    exposures = range(120, 1320, 6)
    truth = [barrier.interrupted(simulation.scene.at(k / 30)) for k in exposures]  # pyright: ignore[reportAttributeAccessIssue]
    readings = [simulation.expose(k)[0][0].data[0, 0] == 255 for k in exposures]
    found = binary.fit(readings, truth, 0.8)
    assert found.miss == pytest.approx(0.1, abs=0.08)
    assert found.false_alarm == pytest.approx(0.1, abs=0.08)


def test_an_error_that_never_happened_is_not_taken_for_impossible():
    crossing = np.arange(20) < 9
    found = binary.fit(crossing, crossing, 0.5)
    assert found == LightBarrier(0.5, miss=0.05, false_alarm=0.5 / 12)
    assert np.isfinite(found.cost(True)).all()


@pytest.mark.parametrize(
    ("interrupted", "crossing", "message"),
    [
        ([1, 1, 0], [1, 1, 1], "false_alarm is unknown: the beam was never free"),
        ([1, 1, 0], [0, 0, 0], "miss is unknown: the beam was never crossed by the object"),
        ([0, 0, 1, 1], [1, 1, 0, 0], "miss is 0.83, but must be less than 0.5: the readings say the opposite"),
    ],
)
def test_readings_that_tell_no_rate_are_refused(interrupted, crossing, message):
    with pytest.raises(NoiseError, match=message):
        binary.fit(interrupted, crossing, 0.5)
