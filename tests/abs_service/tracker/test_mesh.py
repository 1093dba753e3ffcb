"""Edges of triangle meshes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from abs_service.tracker.mesh import edges_of, mean_around, ring_means
from tests.abs_service.tracker.scenes import sheet


@given(hnp.arrays(np.int32, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(0, 50_000)))
def test_edges_are_those_that_numpy_finds_row_by_row(faces):
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    found, belongs = edges_of(faces)
    np.testing.assert_array_equal(found, edges)
    np.testing.assert_array_equal(belongs, count)
    assert found.dtype == np.int32


@given(st.integers(0, 2**32 - 1), st.integers(3, 9))
def test_means_of_rings_are_products_with_their_matrix(seed, rows):
    mean = mean_around(sheet(rows, 7))
    values = np.random.default_rng(seed).standard_normal(mean.shape[0])
    np.testing.assert_allclose(ring_means(mean, values), mean @ values, rtol=1e-12, atol=1e-12)
