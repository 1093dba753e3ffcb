"""Sums over grouped residuals are those of their dense Jacobian."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.grouped import GroupedLinearization
from abs_service.tracker.terms.linearization import Linearization

#: Parameters of theta, and of every group.
DIM, OWN = 11, 5


def drawn(generator: np.random.Generator, counts: list[int]) -> GroupedLinearization:
    """Rows and residuals, as many in every group."""
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
    for part in (grouped, Linearization(residual, jacobian)):
        gradient, curvature = np.ones(DIM), np.ones((DIM, DIM))
        part.add_gradient(gradient)
        part.add_curvature(curvature)
        np.testing.assert_allclose(gradient, 1 + jacobian.T @ residual, atol=1e-12)
        np.testing.assert_allclose(curvature, 1 + jacobian.T @ jacobian, atol=1e-12)
