"""Material that images show beside its vertices widens their covariance by as much; noise and distances do not."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.posterior.covariance.appearance_misfit import (
    AppearanceMisfit,
    NoDisplacement,
    beyond_noise,
)
from abs_service.tracker.terms.linearization import Linearization, PointLinearization
from tests.abs_service.tracker.scenes import sheet

MESH = sheet(13, 17)
N = len(MESH.vertices)
ALONG, ACROSS = np.array([[1.0, 0, 0], [0, 1.0, 0]]), np.array([[0, 0, 1.0]])

#: How well one image shows the place of one vertex, and how far material lies beside it [m].
SIGMA, BESIDE = 2e-4, np.array([2e-3, -1e-3, 0.0])


@dataclass
class Found:
    """An estimate with residuals of its vertices, and the cost around it."""

    residuals: list[Any]

    theta = np.zeros(1)

    def __post_init__(self):
        self.sparse_jacobian = SparseJacobian.from_dense(np.ones((N, 3, 1)))
        self.surface = Surface(*(np.asarray(one, np.float32).T[None] for one in (MESH.vertices, [[0, 0, -1.0]] * N)))

    @property
    def linearized(self) -> "Found":
        return self

    @property
    def sensed(self):
        return [self.part(*one) if isinstance(one, tuple) else one for one in self.residuals]

    def part(self, directions, displacement, noise):
        """Residuals of all vertices along directions (k, 3) whose material lies beside them (n, 3) [m]."""
        rows = np.tile(directions / SIGMA, (N, 1))
        points = np.arange(N).repeat(len(directions))
        residual = noise - np.vecdot(rows, np.broadcast_to(displacement, (N, 3))[points])
        return PointLinearization(residual, rows, points, self.sparse_jacobian, MESH.vertices)


def variance(*residuals: Any, possible: float = 0.0) -> np.ndarray:
    found: Any = Found(list(residuals))
    return AppearanceMisfit(MESH).variance(found, np.full(N, possible))


def test_vertices_beside_their_material_are_off_by_as_much():
    np.testing.assert_allclose(variance((ALONG, BESIDE, 0.0)), 5e-6, rtol=0.05)  # less noise


def test_noise_shows_hardly_any():
    noise = np.random.default_rng(0).standard_normal(2 * N)
    assert variance((ALONG, 0.0, noise)).mean() < 0.1 * SIGMA**2 / 7  # of a vertex and its six neighbours


def test_distances_show_none():
    assert not variance((ACROSS, np.array([0, 0, 5e-3]), 0.0)).any()


def test_a_direction_that_the_print_does_not_show_adds_none():
    lines = ALONG[:1]
    np.testing.assert_allclose(variance((lines, [2e-3, 9e-3, 0], 0.0)), 4e-6, rtol=0.05)


def test_a_plain_part_is_off_as_the_rest_is():
    shows = MESH.vertices[:, :1] > np.median(MESH.vertices[:, 0])
    found = variance((ALONG, np.where(shows, BESIDE, 0), 0.0))
    assert found.max() == pytest.approx(5e-6, rel=0.05)
    assert found.min() == pytest.approx(5e-6 * shows.mean(), rel=0.15)


def test_what_is_sampled_elsewhere_says_nothing_of_the_vertices():
    other = Linearization(np.ones(3), np.ones((3, 1)))
    assert not variance(other).any()
    found: Any = Found([])
    np.testing.assert_array_equal(NoDisplacement().variance(found, np.full(N, 3.0)), 3.0)


def test_images_that_agree_leave_no_more_of_a_misfit_than_they_know_of_the_vertices():
    """Of a vertex inside the mesh, eighteen others within two edges tell as much as it does."""
    left = variance((ALONG, 0.0, 0.0), possible=4e-6).reshape(13, 17)
    assert left[6, 8] == pytest.approx(1 / (1 / 4e-6 + 19 / SIGMA**2), rel=0.05)
    np.testing.assert_allclose(variance((ACROSS, 0.0, 0.0), possible=4e-6), 4e-6, rtol=0.05)
    shown = variance((ALONG, BESIDE, 0.0), possible=4e-6)
    np.testing.assert_allclose(shown, 5e-6, rtol=0.05)


@given(st.integers(0, 2**32 - 1))
def test_the_displacement_is_that_of_plain_matrices(seed):
    generator, n, least = np.random.default_rng(seed), 6, 0.3
    roots, gradient = generator.standard_normal((n, 3, 3)), generator.standard_normal((n, 3))
    squares, normals = roots @ roots.transpose(0, 2, 1), generator.standard_normal((n, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    around = [np.unique([v, *generator.integers(0, n, 3)]) for v in range(n)]
    start, (found, held) = np.cumsum([0, *map(len, around)]).astype(np.int32), np.empty((2, n))
    places = start, np.concatenate(around).astype(np.int32)
    beyond_noise(*places, squares, gradient[..., None], normals.T.copy(), least, found, held)
    for v, ring in enumerate(around):
        tangents = np.linalg.svd(normals[v : v + 1].astype(np.float64))[2][1:]
        information = tangents @ squares[ring].sum(axis=0) @ tangents.T
        inverse = np.linalg.inv(information + least * np.eye(2))
        displacement = -inverse @ tangents @ gradient[ring].sum(axis=0)
        expected = displacement @ displacement - 9 * np.trace(inverse @ information @ inverse)
        np.testing.assert_allclose(held[v], np.trace(inverse) / 2, rtol=1e-4)
        np.testing.assert_allclose(found[v], expected, rtol=1e-4, atol=1e-5)  # normals are of single precision
