"""Residuals of colours, against plain NumPy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.photometric.color_cost import color_residuals


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.booleans())
def test_color_residuals_match_numpy(seed, count, shared):
    generator = np.random.default_rng(seed)
    texture = generator.uniform(0, 255, (60, 3)).astype(np.float32)
    texture[0], texture[7], texture[9, 1] = np.nan, np.inf, np.nan  # border, occluder, unknown
    pixel = generator.integers(-1, len(texture), count).astype(np.int32)
    colors = generator.uniform(0, 255, (3, count)).astype(np.float32)
    colors[2, generator.integers(count)] = np.nan
    inverse = generator.uniform(0.05, 1, (1 if shared else count, 3)).astype(np.float32)
    residual, square = np.empty((count, 3)), np.empty(count)
    color_residuals(pixel, colors, texture, inverse, residual, square)
    expected = (texture[pixel] - colors.T.astype(np.float64)) * inverse
    expected[(pixel <= 0) | ~np.isfinite(expected).all(axis=1)] = np.inf
    np.testing.assert_allclose(residual, expected)
    np.testing.assert_allclose(square, np.sum(expected**2, axis=1))
