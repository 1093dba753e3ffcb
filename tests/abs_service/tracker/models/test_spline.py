"""B-spline and rational basis functions are those of eqs. 3–5."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.parts import spline
from tests import reference

sizes = st.tuples(st.integers(1, 4), st.integers(0, 8)).map(lambda pair: (pair[0], max(3, pair[0] + 1) + pair[1] % 8))
parameters = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 0.25, 1 / 3, 0.5, 2 / 3, 0.7, 1.0]))
EVERY_SIZE = [(degree, n) for degree in range(1, 5) for n in range(max(3, degree + 1), 13)]


@given(sizes, parameters)
def test_base_splines_are_cox_de_boor(size, u):
    degree, n = size
    eta = spline.clamped_knots(n, degree)
    np.testing.assert_allclose(eta, reference.knots(n, degree), rtol=1e-15)
    expected = [reference.base_spline(i, degree, u, eta) for i in range(n)]
    np.testing.assert_allclose(spline.base_splines(np.array([u]), n, degree)[0], expected, atol=1e-12)


@given(sizes, st.floats(0, 1))
def test_their_derivatives_are_cox_de_boor_s(size, u):
    degree, n = size
    eta = spline.clamped_knots(n, degree)
    expected = [reference.base_spline_slope(i, degree, u, eta) for i in range(n)]
    if u < 1:  # at knots, the recursion for degree 1 uses the span on the right
        np.testing.assert_allclose(spline.base_splines(np.array([u]), n, degree, 1)[0], expected, atol=1e-8)


@pytest.mark.parametrize(("degree", "n"), EVERY_SIZE)
def test_they_sum_to_one_and_the_ends_are_the_outer_control_points(degree, n):
    values = spline.base_splines(np.linspace(0, 1, 101), n, degree)
    np.testing.assert_allclose(values.sum(axis=1), 1, rtol=1e-12)
    assert values.min() >= 0
    assert values[0, 0] == values[-1, -1] == 1


WEIGHTS = np.random.default_rng(2).uniform(0.3, 3, (5, 4))


@pytest.mark.parametrize("weights", [np.ones((5, 4)), WEIGHTS], ids=["equal", "different"])
def test_the_rational_basis_is_eq_3(weights):
    generator = np.random.default_rng(3)
    u, w = np.r_[0, 1, generator.uniform(size=20)], np.r_[1, 0, generator.uniform(size=20)]
    basis = spline.rational_basis(u, w, 2, weights)[0].reshape(-1, 5, 4)
    expected = [reference.rational_basis(a, b, 2, weights) for a, b in zip(u, w)]
    np.testing.assert_allclose(basis, expected, atol=1e-12)
    np.testing.assert_allclose(basis.sum(axis=(1, 2)), 1, rtol=1e-12)


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_its_derivatives_are_those_of_its_values(degree):
    u, w, h = *np.random.default_rng(4).uniform(0.01, 0.99, (2, 30)), 1e-6
    weights = np.random.default_rng(2).uniform(0.3, 3, (6, 5))
    value = lambda u, w: spline.rational_basis(u, w, degree, weights)[0]  # noqa: E731
    _, along_u, along_w = spline.rational_basis(u, w, degree, weights)
    np.testing.assert_allclose(along_u, (value(u + h, w) - value(u - h, w)) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(along_w, (value(u, w + h) - value(u, w - h)) / (2 * h), atol=1e-6)


@pytest.mark.parametrize(("degree", "n"), EVERY_SIZE)
def test_the_support_holds_every_control_point_that_moves_a_vertex(degree, n):
    """Includes knots, where rounding determines which of two spans contains a vertex."""
    u = np.unique(np.r_[np.linspace(0, 1, 61), np.linspace(0, 1, n - degree + 1), np.arange(11) / 10])
    w = u[::-1].copy()
    span, control = spline.support(u, w, (n, n), degree)
    assert control.shape == ((n - degree) ** 2, (degree + 1) ** 2)
    for table in spline.rational_basis(u, w, degree, np.ones((n, n))):
        rest = table.copy()
        np.put_along_axis(rest, control[span], 0, axis=1)
        np.testing.assert_allclose(rest, 0, atol=1e-9)
