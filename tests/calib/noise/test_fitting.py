"""Fits find the simulator's laws again, whatever outliers there are, and know how good they are."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from abs_service.config import plugins
from calib.noise import constant, gaussian_polynomial, measured, structured_light, tof_amplitude
from calib.noise.base import NoiseError
from calib.noise.fit import fitting
from calib.noise.fit.quality import goodness_of_fit
from calib.noise.fit.samples import Samples, domain, from_images, joined
from evaluation.calibration import noise_laws

SEEDS = range(4)


def errors(model, x, a, mean, sigma):
    """Largest error of the mean offset [m], and of the deviation as a share of it."""
    p = noise_laws.somewhere(len(x))
    return np.abs(model.mean(x, a, p) - mean).max(), np.abs(model.deviation(x, a, p) / sigma - 1).max()


@pytest.mark.parametrize("outliers", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("seed", SEEDS)
def test_time_of_flight_is_found_again_all_over_its_domain(seed, outliers):
    model = tof_amplitude.fit(noise_laws.time_of_flight(seed, outliers=outliers))
    x, a = noise_laws.grid()
    mean, sigma = errors(model, x, a, noise_laws.TOF.mu(x, a), noise_laws.TOF.sigma(x, a))
    assert mean < 1e-3
    assert sigma < 0.10


@pytest.mark.parametrize("seed", SEEDS)
def test_a_polynomial_fits_where_the_amplitudes_are_of_one_order(seed):
    """From 2000 to 10000; a polynomial is no 1/a, so it fails over several."""
    samples = noise_laws.time_of_flight(seed, 40_000, outliers=0.05)
    samples = samples.take((samples.amplitude > 2000) & (samples.amplitude < 10_000))
    model = gaussian_polynomial.fit(samples, sigma_degrees=(1, 2), mu_degrees=(1, 2))
    x, a, p = samples.true, samples.amplitude, samples.pixels
    assert np.abs(model.mean(x, a, p) - noise_laws.TOF.mu(x, a)).max() < 1e-3
    assert np.quantile(np.abs(model.deviation(x, a, p) / noise_laws.TOF.sigma(x, a) - 1), 0.97) < 0.10


@pytest.mark.parametrize(("outliers", "floor"), [(0.0, 0.0), (0.1, 0.0), (0.05, 2e-3)])
@pytest.mark.parametrize("seed", SEEDS)
def test_structured_light_is_found_again(seed, outliers, floor):
    samples = noise_laws.structured_light(seed, outliers=outliers, floor=floor)
    model = structured_light.fit(samples, noise_laws.KINECT.step)
    x = np.linspace(0.6, 3.5, 30)
    truth = np.hypot(noise_laws.structured_light_deviation(x), floor)
    assert errors(model, x, x, 0, truth)[1] < 0.10
    assert model.noise == pytest.approx(noise_laws.KINECT.random, rel=0.15)
    assert model.floor == pytest.approx(floor, abs=4e-4)
    assert model.step == noise_laws.KINECT.step


def test_a_step_that_is_larger_than_all_there_is_leaves_no_noise_but_a_model():
    model = structured_light.fit(noise_laws.structured_light(0), step=0.1)
    assert 0 < model.noise < 1e-3
    assert model.floor >= 0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_constant_is_found_again(seed):
    generator = np.random.default_rng(seed)
    x = generator.uniform(0.5, 2, 5000)
    measured = noise_laws.scattered(generator, x - 0.02 + 4e-3 * generator.standard_normal(5000), 0.1)
    model = constant.fit(Samples(measured, x, np.full(5000, np.nan), *noise_laws.somewhere(5000)))
    assert model.sigma == pytest.approx(4e-3, rel=0.05)
    assert model.offset == pytest.approx(-0.02, abs=3e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_factor_and_floor_on_a_sensor_s_own_deviations_are_found_again(seed):
    generator = np.random.default_rng(seed)
    x, own = generator.uniform(0.5, 2, 20_000), np.exp(generator.uniform(np.log(5e-4), np.log(1e-2), 20_000))
    truth = measured.Measured(2.5, 3e-3)
    drawn = x + truth.deviation(x, own, noise_laws.somewhere(20_000)) * generator.standard_normal(20_000)
    model = measured.fit(Samples(noise_laws.scattered(generator, drawn, 0.05), x, own, *noise_laws.somewhere(20_000)))
    assert model.factor == pytest.approx(2.5, rel=0.05)
    assert model.floor == pytest.approx(3e-3, rel=0.05)


FITS = {
    "constant": constant.fit,
    "line": lambda samples: gaussian_polynomial.fit(samples, (1, 0), (1, 0)),
    "polynomial": lambda samples: gaussian_polynomial.fit(samples, (1, 3), (1, 3)),
    "law": tof_amplitude.fit,
}


def test_the_more_a_model_says_of_the_sensor_the_likelier_are_samples_that_it_never_saw():
    known, held_out = noise_laws.time_of_flight(1, outliers=0.05), noise_laws.time_of_flight(2, outliers=0.05)
    likelihood = [goodness_of_fit(fit(known), held_out).log_likelihood for fit in FITS.values()]
    assert sorted(likelihood) == likelihood
    assert likelihood[-1] > likelihood[0] + 0.2


@pytest.mark.parametrize("seed", SEEDS)
def test_as_many_unseen_samples_as_promised_lie_within_one_and_two_deviations(seed):
    pairs = [
        (tof_amplitude.fit, noise_laws.time_of_flight),
        (lambda samples: structured_light.fit(samples, noise_laws.KINECT.step), noise_laws.structured_light),
    ]
    for fit, law in pairs:
        quality = goodness_of_fit(fit(law(seed, outliers=0.05)), law(seed + 100, outliers=0.05))
        assert quality.within_one == pytest.approx(0.683, abs=0.02)
        assert quality.within_95 == pytest.approx(0.95, abs=0.01)
        assert quality.variance == pytest.approx(1, abs=0.05)
        assert quality.outlier_share == pytest.approx(0.05, abs=0.01)


def test_a_model_that_is_wrong_by_a_factor_is_told_by_the_variance():
    right = tof_amplitude.fit(noise_laws.time_of_flight(1))
    halves = {"sigma": tuple(s / 2 for s in right.sigma), "sigma_amplitude": right.sigma_amplitude / 2}
    half = dataclasses.replace(right, **halves, minimum_sigma=1e-4)
    quality = goodness_of_fit(half, noise_laws.time_of_flight(2))
    assert quality.variance == pytest.approx(4, rel=0.1)
    assert quality.within_95 < 0.75


def test_a_model_that_explains_nothing_is_no_reason_to_fail():
    quality = goodness_of_fit(constant.Constant(1e-4, offset=1.0), noise_laws.time_of_flight(1))
    assert quality.outlier_share == 0.5
    assert np.isfinite(quality.log_likelihood)
    assert np.isnan(quality.variance)
    assert quality.within_95 == 0


@pytest.mark.parametrize("name", FITS)
def test_the_same_samples_give_the_same_model_and_no_returns_change_nothing(name):
    samples = noise_laws.time_of_flight(1, 3000, outliers=0.02)
    measured, true = [np.nan, np.inf, -1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0, np.nan, np.inf]
    lost = Samples(np.array(measured), np.array(true), np.full(6, 3000.0), *noise_laws.somewhere(6))
    both = joined([samples, lost])
    assert FITS[name](samples) == FITS[name](both) == FITS[name](samples)


def test_amplitudes_that_are_none_count_only_where_they_are_needed():
    samples = noise_laws.time_of_flight(1, 3000)
    samples.amplitude[:1000] = np.nan
    samples.amplitude[1000:1100] = 0.0
    assert tof_amplitude.fit(samples) == tof_amplitude.fit(samples.take(np.arange(1100, 3000)))
    dark = samples.take(np.arange(1000))
    assert not FITS["line"](dark).uses_amplitude
    with pytest.raises(NoiseError, match="none of 1000 samples has a distance and an amplitude"):
        tof_amplitude.fit(dark)


def test_without_samples_there_is_no_model():
    nothing = noise_laws.time_of_flight(1, 10).take(np.zeros(10, bool))
    for fit in FITS.values():
        with pytest.raises(NoiseError, match="none of 0 samples"):
            fit(nothing)


def test_arrays_of_different_length_are_no_samples():
    with pytest.raises(NoiseError, match="one length"):
        Samples(np.ones(3), np.ones(3), np.ones(2), np.ones(3, int), np.ones(3, int))


def test_bright_returns_that_err_more_are_not_read_as_a_negative_law():
    samples = noise_laws.time_of_flight(3)
    generator = np.random.default_rng(3)
    odd = samples.true + (1e-3 + samples.amplitude * 1e-6) * generator.standard_normal(len(samples))
    model = tof_amplitude.fit(dataclasses.replace(samples, measured=odd))
    assert model.sigma_amplitude == 0
    assert model.deviation(*noise_laws.grid(), noise_laws.somewhere(400)).min() > 0


def test_where_the_domain_s_corner_holds_no_sample_the_deviation_is_no_less_than_elsewhere():
    samples = noise_laws.time_of_flight(4)
    sigma = gaussian_polynomial.fit(samples, (1, 3), (1, 1)).deviation(*noise_laws.grid(), noise_laws.somewhere(400))
    assert sigma.min() > 0.8 * noise_laws.TOF.sigma(samples.true, samples.amplitude).min()


@pytest.mark.parametrize("seed", SEEDS)
def test_where_the_domain_s_corner_holds_no_sample_no_offset_is_trusted(seed):
    """A polynomial says something there: here up to 9 cm, if nothing held it, for a far and bright surface."""
    model = gaussian_polynomial.fit(noise_laws.time_of_flight(seed, outliers=0.05), (1, 3), (1, 3))
    (x, a), p = noise_laws.grid(), noise_laws.somewhere(400)
    error = np.abs(model.mean(x, a, p) - noise_laws.TOF.mu(x, a))
    assert error.max() < 0.025
    assert (error / model.deviation(x, a, p)).max() < 3


def test_more_samples_than_needed_are_thinned_and_tell_the_same(monkeypatch):
    samples = noise_laws.time_of_flight(5)
    everything = tof_amplitude.fit(samples)
    monkeypatch.setattr(fitting, "MAX_SAMPLES", 5000)
    assert len(fitting.subsampled(samples)) == 5000
    everywhere = *noise_laws.grid(), noise_laws.somewhere(400)
    ratio = tof_amplitude.fit(samples).deviation(*everywhere) / everything.deviation(*everywhere)
    assert np.abs(ratio - 1).max() < 0.1


def at_one_distance(n=200):
    """A sensor that repeats itself, before one board."""
    return Samples(np.full(n, 1.02), np.full(n, 1.0), np.full(n, 500.0), *noise_laws.somewhere(n))


def test_measurements_that_are_all_equal_are_fitted_too():
    assert constant.fit(at_one_distance()).offset == pytest.approx(0.02, abs=1e-6)
    model = gaussian_polynomial.fit(at_one_distance(), (0, 0), (0, 0))
    assert model.distances == pytest.approx((0.999, 1.001))
    assert 0 < model.deviation(np.ones(1), np.ones(1), noise_laws.somewhere(1))[0] < 1e-3


@pytest.mark.parametrize("name", ["line", "polynomial", "law"])
def test_samples_that_vary_too_little_for_a_model_are_no_reason_to_guess(name):
    with pytest.raises(NoiseError, match=r"vary too little to tell .* more distances"):
        FITS[name](at_one_distance())


@pytest.mark.parametrize("power", [1, 2])
def test_the_gradients_of_the_fit_are_those_of_its_cost(power):
    generator = np.random.default_rng(1)
    columns = fitting.Design(generator.normal(size=(50, 2)), generator.uniform(0.5, 2, (50, 3)))
    samples = fitting.ResidualSamples(generator.normal(size=50), columns, power, 0.01)
    imagined = fitting.PseudoSamples(0.3, columns, power)
    at, steps = np.array([0.2, -0.1, 0.5, 0.3, 0.4, -2.0]), 1e-6 * np.eye(6)
    for cost in (lambda p: samples.cost(p[:2], p[2:5], p[5]), lambda p: imagined.cost(p[:2], p[2:5])):
        differences = [(cost(at + step)[0] - cost(at - step)[0]) / 2e-6 for step in steps]
        np.testing.assert_allclose(cost(at)[1], differences, rtol=1e-5, atol=1e-6)


def test_the_domain_leaves_outliers_aside():
    values = np.concatenate([np.linspace(1, 2, 10_000), [1e-3, 500.0]])
    low, high = domain(values)
    assert 1 < low < 1.01
    assert 1.99 < high < 2


def test_images_become_samples_pixel_by_pixel():
    measured = np.arange(12.0).reshape(2, 2, 3)
    samples = from_images(measured, np.full((2, 3), 0.5), np.nan)
    assert len(samples) == 12
    np.testing.assert_array_equal(samples.measured, measured.ravel())
    np.testing.assert_array_equal(samples.residual, measured.ravel() - 0.5)
    assert samples.row.tolist() == [0, 0, 0, 1, 1, 1] * 2
    assert samples.column.tolist() == [0, 1, 2] * 4


@pytest.mark.parametrize("name", FITS)
def test_what_was_fitted_can_be_written_into_a_rig_file(name):
    model = FITS[name](noise_laws.time_of_flight(1, 3000))
    assert plugins.load("calib.noise", plugins.table(model), Path()) == model
