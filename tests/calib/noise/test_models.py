"""Every noise model says what its formula says, is sensible outside its domain, and names bad parameters."""

import numpy as np
import pytest
from annotated_types import Ge, Gt, Interval

from calib.noise import constant, gaussian_polynomial, structured_light, tof_amplitude
from calib.noise.base import NoiseError, log_density
from calib.noise.constant import Constant
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images import color
from calib.noise.pixel_polynomial import PixelPolynomial
from calib.noise.region_polynomial import RegionPolynomial
from calib.noise.structured_light import StructuredLight
from calib.noise.tof_amplitude import TofAmplitude
from tests.calib.noise.models import DISTANCES, GLOBAL, MODELS, SIGMA, TOF, pixel_maps, region_tables

X, A = np.array([0.6, 1.0, 2.5]), np.array([200.0, 3000.0, 9000.0])
P = (np.array([0, 3, 2]), np.array([4, 1, 0]))
PLAIN = [color, constant, gaussian_polynomial, structured_light, tof_amplitude]


def test_the_polynomial_is_the_sum_of_its_powers():
    expected = [2e-3 - 1e-7 * a + 5e-4 * x + 1e-4 * x**2 for x, a in zip(X, A)]
    np.testing.assert_allclose(GLOBAL.deviation(X, A, P), expected, rtol=1e-12)
    np.testing.assert_allclose(GLOBAL.mean(X, A, P), [0.01 + 1e-6 * a - 2e-3 * x for x, a in zip(X, A)], rtol=1e-12)


def test_time_of_flight_errs_inversely_to_the_amplitude():
    np.testing.assert_allclose(TOF.deviation(X, A, P), [1.5e-3 + 5e-4 * x + 9 / a for x, a in zip(X, A)], rtol=1e-12)
    np.testing.assert_allclose(TOF.mean(X, A, P), [0.01 - 2e-3 * x - 6 / a for x, a in zip(X, A)], rtol=1e-12)


def test_a_constant_is_the_same_everywhere():
    np.testing.assert_array_equal(Constant(3e-3, 0.01).deviation(X, A, P), np.full(3, 3e-3))
    np.testing.assert_array_equal(Constant(3e-3, 0.01).mean(X, A, P), np.full(3, 0.01))


@pytest.mark.parametrize("make", [pixel_maps, region_tables])
def test_equal_coefficients_everywhere_are_the_whole_image_model(make):
    np.testing.assert_allclose(make().deviation(X, A, P), GLOBAL.deviation(X, A, P), rtol=1e-12)
    np.testing.assert_allclose(make().mean(X, A, P), GLOBAL.mean(X, A, P), rtol=1e-12)


def test_every_pixel_has_its_own_coefficients():
    maps = pixel_maps()
    maps.mu[0, 0, 3, 1] += 0.5
    np.testing.assert_allclose(maps.mean(X, A, P) - GLOBAL.mean(X, A, P), [0, 0.5, 0], atol=1e-12)


def test_every_region_has_its_own_coefficients():
    tables = region_tables(side=2)  # three by two regions; the three pixels lie in the third, the fourth and the fourth
    assert tables.labels[P].tolist() == [2, 3, 3]
    tables.sigma[0, 0, 3] += 0.5
    np.testing.assert_allclose(tables.deviation(X, A, P) - GLOBAL.deviation(X, A, P), [0, 0.5, 0.5], atol=1e-12)


@pytest.mark.parametrize("make", [pixel_maps, region_tables])
def test_a_pixel_outside_the_maps_is_an_error_and_not_another_pixel_s_noise(make):
    with pytest.raises(IndexError):
        make().mean(X, A, (np.array([0, 0, 4]), np.array([0, 0, 4])))


@pytest.mark.parametrize("name", MODELS)
def test_several_distances_of_a_pixel_are_answered_at_once(name):
    model, several = MODELS[name], np.stack([X, X + 0.1, X - 0.05])
    for law in (model.mean, model.deviation):
        np.testing.assert_array_equal(law(several, A, P), np.stack([law(x, A, P) for x in several]))


@pytest.mark.parametrize("name", ["gaussian_polynomial", "pixel_polynomial", "region_polynomial", "tof_amplitude"])
def test_outside_the_calibrated_domain_the_edge_s_value_holds(name):
    model = MODELS[name]
    for outside, edge in (((0.1, 0.0), (0.5, 100.0)), ((50.0, 1e6), (3.0, 10_000.0)), ((1.0, -5.0), (1.0, 100.0))):
        (x, a), (x_edge, a_edge) = ((np.full(3, value) for value in pair) for pair in (outside, edge))
        np.testing.assert_array_equal(model.deviation(x, a, P), model.deviation(x_edge, a_edge, P))
        np.testing.assert_array_equal(model.mean(x, a, P), model.mean(x_edge, a_edge, P))


def test_the_deviation_is_never_below_its_bound():
    steep = GaussianPolynomial(((1e-2,), (-1e-2,)), minimum_sigma=2e-3)
    np.testing.assert_allclose(steep.deviation(np.array([0.5, 0.9, 5.0]), A, P), [5e-3, 2e-3, 2e-3])
    falling = TofAmplitude((1e-2, -1e-2), 0.0, minimum_sigma=2e-3)
    np.testing.assert_allclose(falling.deviation(np.array([0.5, 0.9, 5.0]), A, P), [5e-3, 2e-3, 2e-3])
    domain = np.array(DISTANCES), np.array([0.0, 1.0])
    below, none = np.full((1, 1, 4, 5), -1.0), np.zeros((1, 1, 4, 5))
    np.testing.assert_array_equal(PixelPolynomial(below, none, *domain, 3e-3).deviation(X, A, P), 3e-3)
    regions = RegionPolynomial(np.zeros((4, 5), int), below[..., 0, :1], none[..., 0, :1], *domain, 3e-3)
    np.testing.assert_array_equal(regions.deviation(X, A, P), 3e-3)


@pytest.mark.parametrize(
    "model",
    [
        Constant(1e-3),
        GaussianPolynomial(((1e-3,), (1e-3,))),
        StructuredLight(),
        TofAmplitude((1e-3, 1e-3), 0.0),
        pixel_maps(((1e-3,), (1e-3,)), ((0.0,),)),
        region_tables(((1e-3,), (1e-3,)), ((0.0,),)),
    ],
    ids=lambda model: type(model).__name__,
)
def test_an_amplitude_that_nothing_depends_on_may_be_missing(model):
    assert not model.uses_amplitude
    missing = np.full(3, np.nan)
    assert np.isfinite(log_density(model, X, X, missing, P)).all()


@pytest.mark.parametrize("name", ["gaussian_polynomial", "pixel_polynomial", "region_polynomial", "tof_amplitude"])
def test_a_missing_amplitude_that_something_depends_on_gives_no_number(name):
    model = MODELS[name]
    assert model.uses_amplitude
    assert np.isnan(log_density(model, X, X, np.array([np.nan, 3000.0, np.nan]), P)).tolist() == [True, False, True]


#: Distances (middles of the bins) and median deviations over time of a PrimeSense-type sensor's pixels [m], from 120
#: frames of the data set agpetit/RGBDTracking.
MEASURED = np.array(
    [(0.5, 0.41), (0.6, 0.50), (0.725, 0.85), (1.15, 2.00), (1.5, 2.33), (2.5, 8.70), (3.15, 12.27)]
) * (1, 1e-3)


def test_structured_light_errs_as_one_was_measured_to():
    x, sigma = MEASURED.T
    model = StructuredLight().deviation(x, np.zeros(7), (np.zeros(7, int), np.zeros(7, int)))
    np.testing.assert_allclose(model**2, (1.425e-3**2 + 2.85e-3**2 / 12) * x**4, rtol=1e-12)
    error = np.abs(model / sigma - 1)
    assert np.sort(error)[4] < 0.20  # five of the seven bins
    assert error.max() < 0.60  # the worst is at 1.5 m, where the published law is 38 % off by itself


def test_the_floor_of_structured_light_adds_its_variance():
    near = np.array([1e-3])
    assert StructuredLight(floor=4e-4).deviation(near, near, P)[0] == pytest.approx(4e-4, rel=1e-4)


@pytest.mark.parametrize(
    ("model", "parameters", "message"),
    [
        (GaussianPolynomial, {"sigma": ()}, "sigma must be a table"),
        (GaussianPolynomial, {"sigma": ((),)}, "sigma must be a table"),
        (GaussianPolynomial, {"sigma": ((1e-3, 0.0), (1e-3,))}, "sigma must be a table of rows of equal length"),
        (GaussianPolynomial, {"sigma": SIGMA, "mu": ((0.0,), (0.0, 1.0))}, "mu must be a table of rows of equal"),
        (GaussianPolynomial, {"sigma": SIGMA, "distances": (3.0, 0.5)}, r"distances must be .* not \[3.0, 0.5\]"),
        (GaussianPolynomial, {"sigma": SIGMA, "amplitudes": (1.0, 1.0)}, r"amplitudes must be .* not \[1.0, 1.0\]"),
        (TofAmplitude, {"sigma": ()}, r"sigma must be a list of numbers, sigma\[i\]"),
        (TofAmplitude, {"mu": ()}, "mu must be a list of numbers"),
        (TofAmplitude, {"distances": (3.0, 0.5)}, r"distances must be .* not \[3.0, 0.5\]"),
        (TofAmplitude, {"amplitudes": (0.0, 9.0)}, r"amplitudes must begin above 0, .* not \[0.0, 9.0\]"),
    ],
)
def test_bad_parameters_are_named(model, parameters, message):
    needed = {"sigma": (1e-3,), "sigma_amplitude": 1.0} if model is TofAmplitude else {}
    with pytest.raises(NoiseError, match=message):
        model(**needed | parameters)


@pytest.mark.parametrize("module", PLAIN)
def test_settings_of_a_model_without_files_are_the_model(module):
    needed = {
        constant: {"sigma": 1e-3},
        gaussian_polynomial: {"sigma": ((1e-3,),)},
        tof_amplitude: {"sigma": (1e-3,), "sigma_amplitude": 9.0},
    }
    settings = module.Settings(**needed.get(module, {}))
    assert settings.build() is settings


def test_ranges_of_numbers_are_declared():
    bounds = {
        (module.__name__.rpartition(".")[2], name): annotation.__metadata__
        for module in PLAIN
        for name, annotation in module.Settings.__annotations__.items()
        if hasattr(annotation, "__metadata__")
    }
    assert bounds == {
        ("color", "sigma"): (Gt(0),),
        ("constant", "sigma"): (Interval(gt=0, le=0.5),),
        ("gaussian_polynomial", "minimum_sigma"): (Gt(0),),
        ("structured_light", "noise"): (Gt(0),),
        ("structured_light", "step"): (Ge(0),),
        ("structured_light", "floor"): (Ge(0),),
        ("tof_amplitude", "sigma_amplitude"): (Ge(0),),
        ("tof_amplitude", "minimum_sigma"): (Gt(0),),
    }
