"""Counts of pixels on and beside a mesh, as NumPy counts them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.depth.continuation import count_within, find_explained

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_pixels_on_the_mesh_are_counted(seed):
    generator = np.random.default_rng(seed)
    distance = generator.uniform(0.5, 2, (7, 9)).astype(np.float32)
    distance[generator.random((7, 9)) < 0.4] = np.inf
    shown, off = generator.random((7, 9)) < 0.5, np.empty((7, 9), np.uint8)
    explained, mean_m = find_explained(distance, shown, off)
    on_mesh = np.isfinite(distance)
    np.testing.assert_array_equal(off, ~on_mesh)
    assert explained == np.count_nonzero(on_mesh & shown)
    np.testing.assert_allclose(mean_m, distance[on_mesh].mean() if on_mesh.any() else np.nan, rtol=1e-5)


@given(SEEDS)
def test_pixels_beside_the_mesh_are_counted_up_to_a_distance(seed):
    generator = np.random.default_rng(seed)
    away, shown = generator.uniform(0, 5, (7, 9)).astype(np.float32), generator.random((7, 9)) < 0.5
    expected = np.count_nonzero(shown & (away > 1.5) & (away <= 3))
    assert count_within(away, shown, 1.5, 3.0) == expected
