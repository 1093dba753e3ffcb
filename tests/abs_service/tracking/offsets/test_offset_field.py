"""Offsets of a mesh against the same equations with dense matrices."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracking.offsets.offset_field import OffsetField, Prior, change_prior, offset_prior
from tests.abs_service.tracking.offsets.offset_sheet import flat_mesh

MESH = flat_mesh()
N = len(MESH.vertices)


def dense(precision: np.ndarray, prior: Prior) -> np.ndarray:
    """Precision matrix (n, n) of the offsets, edge by edge."""
    degree = np.bincount(MESH.edges.ravel())
    matrix = np.diag(precision + prior.precision)
    for i, j in MESH.edges:
        weight = prior.coupling * 6 / min(degree[i], degree[j])
        matrix[[i, j], [i, j]] += weight
        matrix[[i, j], [j, i]] -= weight
    return matrix


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-4, 3e-3), st.floats(1e-4, 1e-2), st.floats(0, 1), st.integers(0, 2**32))
def test_offsets_are_those_of_the_dense_equations(sigma, size, alike, seed):
    generator = np.random.default_rng(seed)
    rest, mean = 2e-3 * generator.standard_normal((2, N))
    precision = generator.uniform(0, 1, N) * (generator.uniform(size=N) < 0.8) / sigma**2  # some know nothing
    prior = Prior(rest, np.full(N, 1 / size**2), alike / size**2)
    field, matrix = OffsetField(MESH), dense(precision, prior)
    found = field.solve(mean, precision, prior, np.zeros(N))
    np.testing.assert_allclose(found, rest + np.linalg.solve(matrix, precision * (mean - rest)), atol=1e-6)
    rounds = [field.variance(precision, prior) for _ in range(20)]
    share = rounds[-1] / np.diag(np.linalg.inv(matrix))
    assert share.min() > 0.7  # hearsay returns
    assert share.max() < 1 + 1e-9
    assert share.mean() > 0.85


@given(st.integers(0, 2**32 - 1))
def test_variances_are_those_of_messages_along_every_edge(seed):
    generator, degree = np.random.default_rng(seed), np.bincount(MESH.edges.ravel())
    precision, prior = generator.uniform(0, 1e6, N), Prior(np.zeros(N), np.full(N, 1e5), 1e5)
    field, messages = OffsetField(MESH), {(int(i), int(j)): 0.0 for edge in MESH.edges for i, j in (edge, edge[::-1])}
    square = {(i, j): (prior.coupling * 6 / min(degree[i], degree[j])) ** 2 for i, j in messages}
    diagonal = np.diag(dense(precision, prior))
    for _ in range(2):
        received = {edge: square[edge] * message for edge, message in messages.items()}
        known = diagonal.copy()
        for (_, to), each in received.items():
            known[to] -= each
        messages = {(i, j): 1 / (known[i] + received[j, i]) for i, j in messages}
        rest = diagonal.copy()
        for (i, to), each in messages.items():
            rest[to] -= square[i, to] * each
        np.testing.assert_allclose(field.variance(precision, prior), 1 / rest)


def test_without_coupling_every_vertex_is_alone():
    precision = np.linspace(0, 1e6, N)
    prior, mean = Prior(np.zeros(N), np.full(N, 1e5), 0.0), np.linspace(-1e-3, 1e-3, N)
    field = OffsetField(MESH)
    np.testing.assert_allclose(
        field.solve(mean, precision, prior, mean), mean * precision / (precision + 1e5), atol=1e-12
    )
    np.testing.assert_allclose(field.variance(precision, prior), 1 / (precision + 1e5))


def test_a_relief_is_as_large_and_as_smooth_as_it_shows_beyond_its_noise():
    generator, deviation = np.random.default_rng(1), np.full(N, 1e-3)
    noise = 1e-3 * generator.standard_normal(N)
    waves = 3e-3 * np.sin(MESH.chart[:, 0])
    size = {
        name: offset_prior(offset, deviation, MESH, 0) for name, offset in (("flat", noise), ("wavy", noise + waves))
    }
    assert size["flat"].precision[0] ** -0.5 < 0.6e-3
    np.testing.assert_allclose(size["wavy"].precision[0] ** -0.5, np.std(waves), rtol=0.15)
    assert size["wavy"].coupling > 0
    assert offset_prior(3e-3 * generator.standard_normal(N), deviation, MESH, 0).coupling < size["wavy"].coupling / 3


def test_changes_that_neighbours_need_not_share_are_not_coupled():
    assert change_prior(np.zeros(N), np.full(N, 1e-6), 0.1).coupling == 0
    assert change_prior(np.zeros(N), np.full(N, 1e-6), 1e-4).coupling > 1e7
