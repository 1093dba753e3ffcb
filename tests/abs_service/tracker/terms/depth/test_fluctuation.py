"""Fluctuation of distances from frame to frame: noise counts, and what the model cannot follow does not."""

import numpy as np
import pytest

from abs_service.tracker.terms.depth.fluctuation import FEWEST, MIN_VERTICES, Fluctuation

DEVIATION = 1e-3


def after(frames: int, noise: float, misfit: np.ndarray, drift: float = 0.0) -> float:
    """Scale after some frames with noise [deviations], and a misfit (n,) [m] that grows by so much a frame [m]."""
    generator, fluctuation = np.random.default_rng(3), Fluctuation()
    for k in range(frames):
        distance = misfit * (1 + k * drift) + generator.normal(0, noise * DEVIATION, misfit.size)
        fluctuation.update(distance, np.full(misfit.size, DEVIATION))
    return fluctuation.scale


@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0, 1.3])
def test_noise_as_large_as_stated_or_smaller_changes_nothing(noise):
    assert after(40, noise, np.zeros(300)) == 1


@pytest.mark.parametrize("noise", [2.0, 4.0])
def test_more_noise_than_stated_is_found_whatever_the_model_misses(noise):
    wrinkles = 0.01 * np.sin(np.arange(300))
    for misfit in (np.zeros(300), wrinkles):
        assert after(40, noise, misfit) == pytest.approx(noise, rel=0.15)
    assert after(FEWEST, noise, wrinkles) == 1  # there are no more than FEWEST − 1 differences


def test_a_misfit_that_lasts_or_moves_slowly_is_no_noise():
    wrinkles = 0.02 * np.sin(np.arange(300))
    assert after(40, 1.0, wrinkles, drift=0.03) == 1


def test_too_little_in_sight_and_another_mesh_change_nothing():
    assert after(40, 4.0, np.zeros(MIN_VERTICES - 1)) == 1
    fluctuation, generator = Fluctuation(), np.random.default_rng(1)
    for k in range(40):  # every other frame has another number of vertices
        fluctuation.update(generator.normal(0, 0.1, 100 + k % 2), np.full(100 + k % 2, DEVIATION))
    assert fluctuation.scale == 1


def test_a_vertex_counts_only_where_both_frames_measure_it():
    fluctuation, generator = Fluctuation(), np.random.default_rng(2)
    for k in range(40):
        deviation = np.full(300, DEVIATION)
        hidden = slice(0, 200) if k % 2 else slice(200, 300)
        distance = generator.normal(0, 10 * DEVIATION, 300)
        deviation[hidden] = distance[hidden] = 0.0  # so no vertex is ever measured in two frames
        fluctuation.update(distance, deviation)
    assert fluctuation.scale == 1
