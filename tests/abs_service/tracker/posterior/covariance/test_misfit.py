"""Misfit of the model: what neighbours agree on widens the covariance, what stands alone hardly does."""

import numpy as np

from abs_service.tracker.posterior.covariance.misfit import Misfit
from tests.abs_service.tracker.scenes import sheet

MESH = sheet(21, 31)
MISFIT = Misfit(MESH)
N = len(MESH.vertices)
EXACT, SIGMA = np.zeros(N), np.full(N, 1e-3)


def test_a_surface_that_is_off_as_a_whole_is_off_by_as_much():
    np.testing.assert_allclose(MISFIT.variance(np.full(N, -2e-3), EXACT), 4e-6)


def test_one_vertex_that_is_off_shows_within_two_rings_and_far_less():
    single = np.zeros(N)
    single[10 * 31 + 15] = 2e-3
    variance = MISFIT.variance(single, EXACT).reshape(21, 31)
    assert np.count_nonzero(variance) == 19  # two rings of a grid of triangles
    assert variance.max() < 4e-6 / 49 * 1.01  # the mean over seven, squared


def test_vertices_that_are_off_to_either_side_are_noise():
    noise = np.random.default_rng(0).uniform(-2e-3, 2e-3, N)
    assert np.mean(MISFIT.variance(noise, EXACT)) < 4e-6 / 3 / 5


def test_where_all_agree_nothing_is_added():
    np.testing.assert_array_equal(MISFIT.variance(EXACT, EXACT), 0)


def test_noise_is_no_misfit_and_what_neighbours_share_within_three_deviations_is():
    noise = np.random.default_rng(1).normal(0, SIGMA)
    assert np.mean(MISFIT.variance(noise, SIGMA)) < 0.01 * 1e-6
    shared = MISFIT.variance(noise + 2e-3, SIGMA)  # each vertex agrees with its measurement
    assert 0.5 * 4e-6 < np.mean(shared) < 4e-6
