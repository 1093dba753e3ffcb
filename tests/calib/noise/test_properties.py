"""Properties that every noise model has, whatever its parameters (hypothesis)."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.polynomial.polynomial import polyval2d

from calib.noise.base import log_density
from calib.noise.fit.polynomial import evaluate
from calib.noise.texture import WINDOW_M
from tests.calib.noise.models import AMPLITUDES, DISTANCES, HEIGHT, MODELS, WIDTH, any_model
from tests.calib.noise.texels import negative_log_density, render_texture

PIXEL = st.tuples(st.integers(0, HEIGHT - 1), st.integers(0, WIDTH - 1))
INSIDE = st.tuples(st.floats(*DISTANCES), st.floats(*AMPLITUDES))
ANYWHERE = st.tuples(st.floats(1e-6, 1e6), st.floats(-1e6, 1e9))


def repeat(n, condition, pixel):
    """A real distance, an amplitude and a pixel, n times."""
    (x, a), (row, column) = condition, pixel
    return np.full(n, x), np.full(n, a), (np.full(n, row), np.full(n, column))


@given(any_model(), INSIDE, PIXEL)
def test_the_density_integrates_to_one(model, condition, pixel):
    x, a, p = repeat(2001, condition, pixel)
    spread = model.deviation(x, a, p)
    measured = x + model.mean(x, a, p) + spread * np.linspace(-8, 8, 2001)
    assert np.trapezoid(np.exp(log_density(model, measured, x, a, p)), measured) == pytest.approx(1, abs=1e-9)


@given(any_model(), ANYWHERE, PIXEL)
def test_the_deviation_is_positive_and_the_offset_finite_wherever_one_asks(model, condition, pixel):
    """Structured light alone has no domain: its deviation grows without end and has no bound but its floor."""
    x, a, p = repeat(1, condition, pixel)
    sigma = model.deviation(x, a, p)[0]
    assert 0 < sigma < np.inf
    assert np.isfinite(model.mean(x, a, p)[0])
    if hasattr(model, "minimum_sigma"):
        assert sigma >= model.minimum_sigma


@given(any_model(), ANYWHERE, PIXEL)
def test_outside_the_domain_nothing_changes_any_more(model, condition, pixel):
    if not hasattr(model, "distances"):
        return
    x, a, p = repeat(1, condition, pixel)
    edge = np.clip(x, *model.distances), np.clip(a, *model.amplitudes)
    assert model.deviation(x, a, p) == model.deviation(*edge, p)
    assert model.mean(x, a, p) == model.mean(*edge, p)


@given(
    arrays(float, st.tuples(st.integers(1, 4), st.integers(1, 4), st.just(5)), elements=st.floats(-3, 3)),
    arrays(float, 7, elements=st.floats(-1, 4)),
    arrays(float, 7, elements=st.floats(-1, 4)),
    st.lists(st.integers(0, 4), min_size=7, max_size=7),
)
def test_the_compiled_polynomial_is_numpy_s(coefficients, x, a, place):
    got = evaluate(coefficients, np.array(place), x, a, (0.0, 3.0), (0.5, 2.0))
    for k in range(7):
        expected = polyval2d(np.clip(x[k], 0, 3), np.clip(a[k], 0.5, 2), coefficients[..., place[k]])
        assert got[k] == pytest.approx(expected, abs=1e-9)


@given(st.integers(0, 1025), st.integers(1, 3))
def test_the_compiled_polynomial_takes_any_number_of_samples(n, nodes):
    x = np.random.default_rng(n).uniform(0, 3, (nodes, n))
    a = np.linspace(0, 1, n)
    got = evaluate(np.array([[[1.0], [2.0]], [[3.0], [4.0]]]), np.zeros(1, int), x, a, (0.0, 3.0), (0.0, 1.0))
    np.testing.assert_allclose(got, 1 + 2 * a + 3 * x + 4 * x * a, atol=1e-12)


#: What the texture may be off by, as in docs/explanation/noise.md: the log-density falls by 4.5 over three deviations.
TEXTURE_TOLERANCE = 0.01


@given(any_model(), st.floats(*DISTANCES), st.floats(*AMPLITUDES), PIXEL)
def test_the_texture_is_the_exact_log_density_within_three_deviations(model, distance, amplitude, pixel):
    """Wherever the window lies in the domain, holds three deviations, and σ changes in it by a tenth at most."""
    row, column = pixel
    images = np.full((HEIGHT, WIDTH), distance, np.float32), np.full((HEIGHT, WIDTH), amplitude, np.float32)
    texel = render_texture(model, *images, 1.6)[row + 1, column + 1]
    x, a, p = repeat(1, (float(np.float32(distance)), float(np.float32(amplitude))), pixel)
    middle = x - model.mean(x, a, p)
    near, far = getattr(model, "distances", (0.1, 100.0))
    assume(near < middle[0] - WINDOW_M and middle[0] + WINDOW_M < far)
    sigma, ends = model.deviation(middle, a, p)[0], np.array([middle + WINDOW_M, middle - WINDOW_M])
    assume(3 * sigma < WINDOW_M and np.abs(model.deviation(ends, a, p) / sigma - 1).max() < 0.1)
    t = sigma * np.linspace(-3, 3, 25)
    _, a, p = repeat(25, (0.0, a[0]), pixel)
    exact = -log_density(model, x[0], middle[0] - t, a, p)
    np.testing.assert_allclose(negative_log_density(texel[None], t)[0], exact, atol=TEXTURE_TOLERANCE)


@given(
    st.sampled_from(sorted(MODELS)),
    arrays(np.float32, (HEIGHT, WIDTH), elements=st.floats(width=32)),
    arrays(np.float32, (HEIGHT, WIDTH), elements=st.floats(width=32)),
)
@example("structured_light", np.full((HEIGHT, WIDTH), 1e30, np.float32), np.ones((HEIGHT, WIDTH), np.float32))
def test_whatever_a_device_reports_the_texture_is_finite(name, distance, amplitude):
    """A texel is uniform where there is no finite distance above zero, or no amplitude for a model that needs one."""
    model = MODELS[name]
    texture = render_texture(model, np.abs(distance), amplitude, 1.6)
    judged = np.isfinite(distance) & (distance != 0) & (np.isfinite(amplitude) | (not model.uses_amplitude))
    silent = np.array([0, 0, 0, 0, 0, 0, 1.6, 0], np.float32)
    assert (texture[1:-1, 1:-1][~judged] == silent).all()
    near = judged & (np.abs(distance) < 1e3)  # farther, single precision has no room for structured light's deviation
    assert np.isfinite(texture[1:-1, 1:-1][near]).all()
    assert (texture[1:-1, 1:-1, 3][near] > 0).all()
