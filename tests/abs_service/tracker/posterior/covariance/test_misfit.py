"""Misfit of the model: what neighbours agree on widens the covariance, what stands alone hardly does.

Along the surface it lasts beyond the frame that shows it.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from abs_service.tracker.posterior.covariance.misfit import CommonDistance, Misfit
from abs_service.tracker.terms.sensor_fit import INLIER_DEVIATIONS
from tests.abs_service.tracker.scenes import sheet

MESH = sheet(21, 31)
N = len(MESH.vertices)
EXACT, SIGMA = np.zeros(N), np.full(N, 1e-3)

#: A mesh without noise.
NONE = np.zeros(N)


def variance(distance: NDArray[np.float64], deviation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance (n,) [m²] across the surface, which is not larger than that along it."""
    across, along = Misfit(MESH).update(distance, deviation, NONE)
    assert np.all(across <= along)
    return across


def test_a_surface_that_is_off_as_a_whole_is_off_by_as_much():
    np.testing.assert_allclose(variance(np.full(N, -2e-3), EXACT), 4e-6)


def test_one_vertex_that_is_off_shows_within_two_rings_and_far_less():
    single = np.zeros(N)
    single[10 * 31 + 15] = 2e-3
    shown = variance(single, EXACT).reshape(21, 31)
    assert np.count_nonzero(shown) == 19  # two rings of a grid of triangles
    assert shown.max() < 4e-6 / 49 * 1.01  # the mean over seven, squared


def test_vertices_that_are_off_to_either_side_are_noise():
    noise = np.random.default_rng(0).uniform(-2e-3, 2e-3, N)
    assert np.mean(variance(noise, EXACT)) < 4e-6 / 3 / 5


def test_where_all_agree_nothing_is_added():
    np.testing.assert_array_equal(variance(EXACT, EXACT), 0)


def test_noise_is_no_misfit_and_what_neighbours_share_within_three_deviations_is():
    noise = np.random.default_rng(1).normal(0, SIGMA)
    assert np.mean(variance(noise, SIGMA)) < 0.01 * 1e-6
    shared = variance(noise + 2e-3, SIGMA)  # each vertex agrees with its measurement
    assert 0.5 * 4e-6 < np.mean(shared) < 4e-6


@pytest.mark.parametrize("seed", range(5))
def test_what_no_ring_tells_from_noise_all_of_them_do(seed):
    """A smooth misfit below the noise, whose mean over seven vertices has three deviations of 1.1 of it."""
    noise, wave = np.random.default_rng(seed).normal(0, SIGMA), 1e-3 * np.sin(np.linspace(0, 12, 21))
    shown = np.mean(variance(noise + np.repeat(wave, 31), SIGMA))
    assert shown == pytest.approx(np.mean(wave**2), rel=0.4)


def test_outliers_that_stand_alone_have_no_part_and_neighbours_that_share_theirs_have():
    """A pixel in twenty lies between object and background, 30 mm behind; or all of three rows do."""
    generator = np.random.default_rng(4)
    noise, single = generator.normal(0, SIGMA), generator.permutation(N)[: N // 20]
    between = noise.copy()
    between[single] = 30e-3
    assert np.mean(variance(between, SIGMA)) < 0.2 * np.mean(SIGMA**2)
    row = noise.reshape(21, 31).copy()
    row[9:12] = 30e-3
    assert variance(row.ravel(), SIGMA).reshape(21, 31)[10].mean() > 0.3 * 30e-3**2


def test_what_a_single_frame_does_not_tell_the_mean_over_frames_does():
    """A misfit of half the noise of a ring: without the frames before, its covariance would come and go."""
    generator, wave = np.random.default_rng(3), 2.5e-4 * np.sin(np.linspace(0, 12, 21))
    misfit, shown, noise = Misfit(MESH), np.zeros(40), np.zeros(40)
    by_noise = Misfit(MESH)
    for k in range(40):
        drawn = generator.normal(0, SIGMA)
        shown[k] = np.mean(misfit.update(drawn + np.repeat(wave, 31), SIGMA, NONE)[0])
        noise[k] = np.mean(by_noise.update(drawn, SIGMA, NONE)[0])
    assert np.all(shown[10:] > 0.3 * np.mean(wave**2))
    assert np.mean(noise) < 0.3 * np.mean(wave**2)


def test_noise_of_the_mesh_is_no_misfit():
    """Vertices keep half as much noise as a distance has, in all frames; their own covariance has it."""
    generator, own = np.random.default_rng(5), np.random.default_rng(6).normal(0, 0.5 * SIGMA)
    known, unknown, shown = Misfit(MESH), Misfit(MESH), np.zeros((2, 30))
    for k in range(30):
        distance = own + generator.normal(0, SIGMA)
        shown[0, k] = np.mean(known.update(distance, SIGMA, 0.25 * SIGMA**2)[0])
        shown[1, k] = np.mean(unknown.update(distance, SIGMA, NONE)[0])
    before, now = np.mean(shown[::-1, 10:], axis=1)
    assert now < 0.2 * before


def frames(*shares: float) -> NDArray[np.float64]:
    """Variances across the surface and along it (frames, 2) [m²], means over the mesh of which such shares are off."""
    misfit, by_place = Misfit(MESH), np.arange(N) / N
    return np.array(
        [np.mean(misfit.update(np.where(by_place < share, 2e-3, 0), EXACT, NONE), axis=1) for share in shares]
    )


def test_a_lasting_misfit_of_the_mesh_fades_along_the_surface_and_ends_across_it_at_once():
    found = frames(*[1.0] * 40, *[0.2] * 15)
    np.testing.assert_allclose(found[:40], 4e-6, rtol=1e-3)
    assert found[40, 0] < 0.25 * 4e-6 < 0.9 * 4e-6 < found[40, 1]
    assert 0.4 * 4e-6 < found[54, 1] < 0.7 * 4e-6
    assert np.all(np.diff(found[40:, 1]) < 0)


def test_a_lasting_misfit_of_a_part_of_the_mesh_counts_along_all_of_it():
    """Two blocks side by side, of which one moves off: the table shows where it was."""
    misfit, off = Misfit(MESH), np.where(np.arange(N) < 0.15 * N, 2e-3, 0)
    across, along = [misfit.update(off, EXACT, NONE) for _ in range(20)][-1]
    assert across[-1] == 0
    assert np.all(along > 0.7 * 0.15 * 4e-6)


@pytest.mark.parametrize("shares", [[1.0] * 40 + [0.0], [0.4] * 40 + [0.0], [1.0] * 40 + [0.05], [0.05] * 40])
def test_nothing_lasts_once_hardly_any_vertex_misses(shares):
    across, along = frames(*shares)[-1]
    assert across == along < 0.06 * 4e-6


def test_a_single_frame_counts_for_a_fifth():
    misfit = Misfit(MESH)
    misfit.update(np.full(N, 2e-3), EXACT, NONE)
    across, along = misfit.update(np.where(np.arange(N) < 0.15 * N, 2e-3, 0), EXACT, NONE)
    assert along[-1] == pytest.approx((0.95 * 0.2 + 0.05 * np.mean(across) / 4e-6) * 4e-6)


@given(st.integers(0, 2**32 - 1))
def test_what_rings_have_beyond_their_noise_matches_numpy(seed: int):
    generator, ring = np.random.default_rng(seed), CommonDistance(MESH)
    distance, deviation = generator.normal(0, 2e-3, N), generator.uniform(0, 2e-3, N)
    mean = ring.mean.toarray()
    squares, noise = (mean @ distance) ** 2, mean**2 @ deviation**2
    most = INLIER_DEVIATIONS**2 * noise
    excess, unnoticed, _ = ring.excess_and_unnoticed(distance, deviation**2)
    np.testing.assert_allclose(excess, np.maximum(squares - most, 0), rtol=1e-9, atol=1e-18)
    assert unnoticed == pytest.approx(np.mean(np.minimum(squares, most)) - np.mean(noise), rel=1e-6)
