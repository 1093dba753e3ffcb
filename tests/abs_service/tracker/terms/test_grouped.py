"""Sums over grouped residuals are those of their dense Jacobian."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.grouped import GroupedLinearization
from abs_service.tracker.terms.linearization import Linearization

#: Parameters of theta, and of every group.
DIM, OWN = 11, 5


def drawn(generator: np.random.Generator, counts: list[int]) -> GroupedLinearization:
    """So many residuals in every group."""
    m, start = sum(counts), np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    parameters = np.array([generator.permutation(DIM)[:OWN] for _ in counts], np.int64)
    return GroupedLinearization(generator.standard_normal(m), generator.standard_normal((m, OWN)), parameters, start)


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 9), min_size=1, max_size=4))
def test_grouped_sums_are_those_of_the_dense_jacobian(seed, counts):
    generator = np.random.default_rng(seed)
    grouped = drawn(generator, counts)
    jacobian, residual = grouped.dense(DIM), grouped.residual
    for group, (first, last) in enumerate(zip(grouped.start[:-1], grouped.start[1:], strict=True)):
        np.testing.assert_array_equal(jacobian[first:last, grouped.parameters[group]], grouped.jacobian[first:last])
        assert np.count_nonzero(jacobian[first:last]) == OWN * (last - first)
    weights, step, half = generator.random(len(residual)), generator.standard_normal(DIM), generator.random((DIM, DIM))
    clusters = generator.integers(0, 3, len(residual))
    by_cluster = np.array([residual[clusters == c] @ jacobian[clusters == c] for c in range(3)])
    for part in (grouped, Linearization(residual, jacobian)):
        gradient, curvature, square, scores = (np.ones(shape) for shape in (DIM, (DIM, DIM), (DIM, DIM), (3, DIM)))
        part.add_gradient(gradient)
        part.add_curvature(curvature)
        part.add_square(weights, square)
        part.add_scores(clusters, scores)
        np.testing.assert_allclose(gradient, 1 + jacobian.T @ residual, atol=1e-12)
        np.testing.assert_allclose(curvature, 1 + jacobian.T @ jacobian, atol=1e-12)
        np.testing.assert_allclose(square, 1 + (jacobian.T * weights) @ jacobian, atol=1e-12)
        np.testing.assert_allclose(scores, 1 + by_cluster, atol=1e-12)
        expected = np.einsum("md,de,me->m", jacobian, half + half.T, jacobian)
        np.testing.assert_allclose(part.leverage(half + half.T), expected, atol=1e-10)
        np.testing.assert_allclose(part.moved(step).residual, residual + jacobian @ step, atol=1e-12)
