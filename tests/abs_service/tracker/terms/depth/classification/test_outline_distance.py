"""Distances from the outline, against NumPy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.depth.classification.outline_distance import join_sides, outvoted


@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.integers(2, 9))
def test_dropouts_go_with_most_of_their_neighbours(seed, height, width):
    generator = np.random.default_rng(seed)
    dropout, beside = generator.random((2, height, width)) < 0.5
    votes = np.where(dropout, 0, np.where(beside, 1, -1))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(votes, 1, mode="reflect"), (3, 3)).sum(axis=(2, 3))
    np.testing.assert_array_equal(outvoted(dropout, beside), dropout & (around > 0))


@given(st.integers(0, 2**32 - 1))
def test_distances_of_both_sides_are_joined_and_unknown_behind_occluders_and_in_holes(seed):
    generator, (top, left) = np.random.default_rng(seed), (2, 1)
    outside = generator.random((5, 6)) < 0.5
    distance = generator.uniform(1, 9, outside.shape).astype(np.float32)
    to_inside, to_outside = np.where(outside, distance, np.float32(0)), np.where(outside, np.float32(0), distance)
    foreground, hole = generator.random((2, 9, 8)) < 0.2
    away = np.empty(outside.shape, np.float32)
    join_sides(to_inside, to_outside, foreground, hole, (top, left), away)
    unknown = (foreground | hole)[top : top + 5, left : left + 6]
    expected = np.where(outside, np.float32(0.5) - distance, distance - np.float32(0.5))
    np.testing.assert_array_equal(away, np.where(unknown, np.float32(np.nan), expected))
