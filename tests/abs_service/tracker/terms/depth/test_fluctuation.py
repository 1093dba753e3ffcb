"""Fluctuation of distances from frame to frame: noise counts, and what the model cannot follow does not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.depth_cost import DepthResiduals
from abs_service.tracker.terms.depth.fluctuation import MIN_FRAMES, MIN_VERTICES, Fluctuation
from abs_service.tracker.terms.depth.observed_depth import MAX_MISFIT_M, write_misfit
from abs_service.tracker.terms.depth.pixel_classes import (
    BEYOND,
    COVERED,
    DOUBTFUL,
    LOST,
    Masks,
    PixelClasses,
    WindowClasses,
    join_classes,
)
from calib.camera import Camera
from calib.noise.constant import Constant
from tests.abs_service.tracker.scenes import as_surface, depth_image, sheet, sparse

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
    assert after(MIN_FRAMES, noise, wrinkles) == 1  # there are no more than MIN_FRAMES − 1 differences


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


def test_what_is_learnt_of_a_frame_counts_from_the_next_one_on():
    """Asked again after its estimate was taken in, a frame answers the same."""
    camera, generator = Camera(160, 120, 150.0, 150.0, 79.5, 59.5), np.random.default_rng(4)
    columns, rows = np.meshgrid(np.arange(30.0, 130.0, 8), np.arange(20.0, 100.0, 8))
    vertices = camera.unproject(np.ones((120, 160)))[rows.astype(int), columns.astype(int)].reshape(-1, 3)
    surface = as_surface((vertices, np.tile([0.0, 0.0, -1.0], (len(vertices), 1))))
    term, scales = DepthTerm("tof", sparse(camera), sheet(10, 13), Constant(DEVIATION), Bounds(0.05, 1.6, 4.6)), []
    for _ in range(MIN_FRAMES + 2):
        frame = term.observe(depth_image(1 + generator.normal(0, 4 * DEVIATION, (120, 160))), Prediction(surface))
        before = frame.fit(surface).normalized_residual
        frame.learn(surface)
        assert frame.fit(surface).normalized_residual == before
        scales.append(frame.scale)
    assert scales[0] == 1
    assert scales[-1] == pytest.approx(4, rel=0.2)


@given(st.integers(0, 2**32 - 1))
def test_the_misfit_of_a_vertex_is_what_its_pixel_shows(seed: int):
    generator, n = np.random.default_rng(seed), 40
    pixel = generator.integers(-1, 30, n).astype(np.int32)
    cost = np.where(generator.random(n) < 0.3, np.inf, 1.0)
    residuals = DepthResiduals(generator.standard_normal(n) * 30, generator.uniform(100, 500, n), cost)
    bits = generator.choice([0, 0, 0, LOST, COVERED, BEYOND, DOUBTFUL, LOST + BEYOND], 30).astype(np.uint8)
    free_m = generator.uniform(0, 0.1, 30).astype(np.float32)
    at, found = np.maximum(pixel, 0), np.zeros((2, n))
    signed = np.clip(residuals.normalized / residuals.inverse_deviation, -MAX_MISFIT_M, MAX_MISFIT_M)
    expected = [
        np.where(cost < np.inf, signed, free_m[at]),
        np.where(cost < np.inf, 1 / residuals.inverse_deviation, 0),
    ]
    write_misfit(pixel, residuals, bits, free_m, found)
    np.testing.assert_allclose(found, expected * ((pixel > 0) & np.isin(bits, [0, BEYOND])[at]))


@given(st.integers(0, 2**32 - 1))
def test_the_classes_of_a_pixel_are_joined_to_bits(seed: int):
    generator = np.random.default_rng(seed)
    masks, free_m = Masks(*(generator.random((5, 4, 6)) < 0.3)), generator.random((4, 6)).astype(np.float32)
    found = WindowClasses(np.empty((4, 6), np.uint8), np.empty_like(free_m), np.empty((4, 6), np.bool_))
    join_classes(masks, free_m, found)
    bits = found.bits
    np.testing.assert_array_equal(found.free_m, np.where(masks.doubtful, 0, free_m))
    np.testing.assert_array_equal(found.masked, masks.hole | masks.foreground | masks.doubtful)
    lost = masks.hole | masks.dropout
    by_bit = ((LOST, lost), (COVERED, masks.foreground), (BEYOND, masks.beyond), (DOUBTFUL, masks.doubtful))
    for bit, mask in by_bit:
        np.testing.assert_array_equal((bits & bit) > 0, mask)


@given(st.integers(0, 2**32 - 1))
def test_samples_have_the_classes_of_their_pixels(seed: int):
    generator, n = np.random.default_rng(seed), 40
    bits, free_m = np.zeros((6, 8), np.uint8), np.zeros((6, 8), np.float32)
    bits[1:-1, 1:-1] = generator.integers(0, 2 * DOUBTFUL, (4, 6))
    free_m[1:-1, 1:-1] = np.maximum(generator.uniform(-0.1, 0.1, (4, 6)), 0)
    pixel, facing = generator.integers(-1, bits.size, n).astype(np.int32), generator.random(n) < 0.5
    found, free = PixelClasses(bits, free_m).of_samples(pixel, facing)
    place = np.where((bits.ravel()[pixel] & BEYOND) > 0, 0, pixel)
    np.testing.assert_array_equal(found.pixel, place)
    np.testing.assert_array_equal(free, (place > 0) & (free_m.ravel()[place] > 0))
    own = bits.ravel()[place]
    masks = found.missing, found.behind_occluder, found.unjudged
    for mask, bit in zip(masks, (LOST, COVERED, DOUBTFUL), strict=True):
        np.testing.assert_array_equal(mask, (own & bit) > 0)
