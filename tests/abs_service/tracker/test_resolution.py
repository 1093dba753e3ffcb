"""Vertices, degree and control points follow from what the first image resolves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import make_lsq_spline

from abs_service.tracker import resolution

HALF_TURN = np.pi
SIDES, CELLS = (0.3, 0.2), (25.0, 17.0)


def spans(sides=SIDES, cells=CELLS, measurements=450, deviation=3e-3, bend=HALF_TURN, degree=3):
    return resolution.spans(sides, cells, measurements, deviation, bend, degree)


@pytest.mark.parametrize(("pixels", "vertices"), [(30, 100), (200, 200), (600, 300), (50_000, 300)])
def test_vertices_follow_from_the_pixels_within_limits(pixels, vertices):
    assert resolution.vertices(pixels) == vertices


@pytest.mark.parametrize(("cells", "degree"), [((25, 17), 3), ((25, 3), 3), ((25, 2), 2), ((2, 2), 2)])
def test_a_side_with_too_few_cells_for_four_control_points_is_quadratic(cells, degree):
    assert resolution.degree(cells) == degree


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_the_error_of_a_spline_is_that_of_the_best_fit_to_an_arc(degree):
    length, bend, count = 0.3, HALF_TURN, 12
    along = np.linspace(0, length, 4001)
    radius = length / bend
    arc = radius * np.column_stack([np.sin(along / radius), np.cos(along / radius)])
    knots = np.concatenate([[0] * degree, np.linspace(0, length, count + 1), [length] * degree])
    missed = make_lsq_spline(along, arc, knots, degree)(along) - arc
    inside = (along > length / 6) & (along < 5 * length / 6)  # at the ends a spline has more freedom
    expected = np.sqrt(np.mean(np.sum(missed[inside] ** 2, axis=1)))
    assert resolution.spline_error(length, bend, count, degree) == pytest.approx(expected, rel=0.1)


def test_a_precise_sensor_has_more_control_points_than_a_noisy_one():
    along = [spans(deviation=deviation)[0] for deviation in (3e-4, 1.5e-3, 5e-3, 0.2)]
    assert along == [3, 3, 2, 1]


def test_a_larger_bend_and_a_larger_object_have_more():
    assert [spans(bend=np.deg2rad(bend))[0] for bend in (30, 120, 360)] == [1, 2, 3]
    assert [spans(sides=(size, size / 1.5))[0] for size in (0.01, 0.2, 1.0)] == [1, 2, 3]


def test_a_strip_has_one_span_across_and_a_square_as_many_on_both_sides():
    assert spans(sides=(0.5, 0.05), cells=(60.0, 6.0), deviation=1e-3) == (3, 1)
    assert spans(sides=(0.2, 0.2), cells=(20.0, 20.0), deviation=1e-3) == (3, 3)
    assert spans(sides=(0.2, 0.3), cells=(17.0, 25.0)) == spans()[::-1]


def test_three_spans_if_the_noise_is_unknown():
    assert spans(deviation=0.0) == (3, 2)


@given(
    st.tuples(st.floats(0.01, 3), st.floats(0.01, 3)),
    st.tuples(st.floats(1, 50), st.floats(1, 50)),
    st.floats(0, 0.1),
    st.integers(1, 4),
)
def test_the_mesh_determines_all_spans(sides, cells, deviation, degree):
    found = spans(sides, cells, 300, deviation, HALF_TURN, degree)
    for count, available in zip(found, cells, strict=True):
        assert 1 <= count <= resolution.MAX_SPANS
        assert count == 1 or available >= resolution.MIN_CELLS * count
