"""Errors against the truth are the displacements that were made."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracking.log.truth import MAX_INTERPOLATION_NS, MAX_TRUTHS, TruthComparison, closest_points


def grid(rows=21, columns=31, bend=0.0):
    x, y = np.meshgrid(np.linspace(-0.15, 0.15, columns), np.linspace(-0.1, 0.1, rows))
    return np.stack([x, y, 1 + bend * x**2], axis=-1)


def inner(count=40, seed=1):
    """Points on the flat grid, away from its rim."""
    x, y = np.random.default_rng(seed).uniform((-0.12, -0.08), (0.12, 0.08), (count, 2)).T
    return np.stack([x, y, np.ones(count)], axis=1)


def comparison(truth):
    """Made at time 0 from the flat grid; `truth` is what there is at time 1."""
    result = TruthComparison()
    result.add_truth(0, grid())
    result.add_topology(inner(), 0)
    result.add_truth(1, truth)
    return result


def test_a_mesh_that_follows_has_no_error():
    moved = grid() + np.array((0.1, -0.02, 0.05))
    errors = comparison(moved).compare(1, inner() + np.array((0.1, -0.02, 0.05)))
    assert errors is not None
    assert errors.vertex_mm == pytest.approx(0, abs=1e-9)
    assert errors.surface_mm == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("shift", "vertex_mm", "surface_mm"),
    [
        ((0, 0, 0.004), 4, 4),  # off the surface
        ((0.005, 0, 0), 5, 0),  # within it: point sets do not notice
        ((0.003, 0, 0.004), 5, 4),
    ],
)
def test_a_known_displacement_has_its_length_as_error(shift, vertex_mm, surface_mm):
    errors = comparison(grid()).compare(1, inner() + shift)
    assert errors is not None
    assert errors.vertex_mm == pytest.approx(vertex_mm, abs=1e-6)
    assert errors.surface_mm == pytest.approx(surface_mm, abs=1e-6)


def test_a_surface_that_slides_under_a_resting_mesh_is_an_error_of_the_vertices_only():
    errors = comparison(grid() + np.array((0.01, 0, 0))).compare(1, inner())
    assert errors is not None
    assert errors.vertex_mm == pytest.approx(10)
    assert errors.surface_mm == pytest.approx(0, abs=1e-6)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.03), st.floats(-2, 2))
def test_the_surface_is_never_farther_than_the_own_point(seed, size, bend):
    vertices = inner() + np.random.default_rng(seed).normal(0, size, (40, 3))
    errors = comparison(grid(bend=bend)).compare(1, vertices)
    assert errors is not None
    assert errors.surface_mm <= errors.vertex_mm + 1e-6


def test_closest_points_of_a_plane_are_the_feet_and_end_at_its_rim():
    points = closest_points(np.array([[0.01, 0.02, 1.3], [-0.04, 0.03, 0.8], [0.5, 0.0, 1.0], [0.5, 0.5, 1.2]]), grid())
    np.testing.assert_allclose(points, [[0.01, 0.02, 1], [-0.04, 0.03, 1], [0.15, 0, 1], [0.15, 0.1, 1]], atol=1e-9)


def test_the_truth_of_the_mesh_may_come_after_the_mesh():
    result = TruthComparison()
    result.add_topology(inner(), 0)
    result.add_truth(1, grid())
    assert result.compare(1, inner()) is None
    result.add_truth(0, grid())
    assert result.compare(1, inner()) is not None


def test_if_the_truth_of_the_mesh_was_lost_the_surface_was_where_it_passed_between_its_neighbours():
    result = TruthComparison()
    result.add_topology(inner() + np.array((0.002, 0, 0)), MAX_INTERPOLATION_NS // 2)
    result.add_truth(0, grid())
    assert result.compare(0, inner()) is None
    result.add_truth(MAX_INTERPOLATION_NS, grid() + np.array((0.004, 0, 0)))
    errors = result.compare(0, inner() + np.array((0.003, 0, 0)))
    assert errors is not None
    assert errors.vertex_mm == pytest.approx(3)


def test_truths_too_far_apart_say_nothing_of_the_time_between():
    result = TruthComparison()
    result.add_topology(inner(), 1)
    result.add_truth(0, grid())
    result.add_truth(MAX_INTERPOLATION_NS + 1, grid())
    assert result.compare(0, inner()) is None


def test_of_two_surfaces_the_nearer_one_is_the_truth():
    result = TruthComparison()
    for t_ns in (0, 1):
        result.add_truth(t_ns, grid() + np.array((0.4 + 0.001 * t_ns, 0, 0.1)), surface=0)
        result.add_truth(t_ns, grid() + np.array((0.002 * t_ns, 0, 0)), surface=1)
    result.add_topology(inner(), 0)
    errors = result.compare(1, inner())
    assert errors is not None
    assert errors.vertex_mm == pytest.approx(2)
    result.add_truth(2, grid(), surface=0)
    assert result.compare(2, inner()) is None


def test_what_is_not_known_has_no_error():
    result = comparison(grid())
    assert result.compare(2, inner()) is None  # no truth of that moment
    assert result.compare(1, inner()[:5]) is None  # another mesh
    assert TruthComparison().compare(0, inner()) is None


def test_a_new_mesh_takes_the_place_of_the_old_one():
    result = comparison(grid())
    result.compare(1, inner())
    result.add_topology(inner(17, seed=2), 1)
    errors = result.compare(1, inner(17, seed=2) + np.array((0, 0, 0.002)))
    assert errors is not None
    assert errors.vertex_mm == pytest.approx(2)


def test_old_truths_are_forgotten_but_not_where_the_mesh_came_from():
    result = comparison(grid())
    assert result.compare(1, inner()) is not None
    for t_ns in range(2, MAX_TRUTHS + 10):
        result.add_truth(t_ns, grid())
    assert result.compare(1, inner()) is None
    assert result.compare(MAX_TRUTHS + 9, inner()) is not None
