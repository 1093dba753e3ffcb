"""Quality of a deformed mesh, without measurements."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.estimates.shape_quality import FOLDED_COSINE, ShapeComparison, percentile
from abs_service.tracker.mesh import area_vectors, edge_lengths
from tests.abs_service.tracker.scenes import flat, sheet

MESH = sheet(9, 13, flat)


def covariances(sigma: float) -> np.ndarray:
    return np.tile(sigma**2 * np.eye(3), (len(MESH.vertices), 1, 1))


def test_a_mesh_at_rest_is_neither_stretched_nor_folded():
    quality = ShapeComparison(MESH).compare(MESH.vertices, covariances(2e-3), 0.0, 0.0)
    assert (quality.stretch, quality.folded_share) == (pytest.approx(0, abs=1e-9), 0)
    assert quality.deviation_m == pytest.approx(np.sqrt(3) * 2e-3)


def test_stretch_is_the_relative_change_of_the_edges():
    quality = ShapeComparison(MESH).compare(MESH.vertices * (1.1, 1.1, 1.0), covariances(1e-3), 0.0, 0.0)
    assert quality.stretch == pytest.approx(0.1)


def test_a_sheet_that_is_folded_in_half_has_folded_faces_along_one_line_only():
    half = MESH.vertices.copy()
    right = half[:, 0] > 1e-6
    half[right, 0] *= -1
    half[right, 2] += 1e-3
    folded = ShapeComparison(MESH).compare(half, covariances(1e-3), 0.0, 0.0).folded_share
    assert 0 < folded < 0.1


def test_bending_is_no_fold():
    roll = MESH.vertices.copy()
    roll[:, 0], roll[:, 2] = 0.1 * np.sin(roll[:, 0] / 0.1), 1.1 - 0.1 * np.cos(roll[:, 0] / 0.1)
    assert ShapeComparison(MESH).compare(roll, covariances(1e-3), 0.0, 0.0).folded_share == 0


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.3))
def test_it_is_what_plain_numpy_finds(seed, noise):
    generator = np.random.default_rng(seed)
    crumpled = (MESH.vertices + noise * generator.normal(size=MESH.vertices.shape)).astype(np.float32)
    spread = generator.random((len(crumpled), 3, 3))
    quality = ShapeComparison(MESH).compare(crumpled, spread, 0.0, 0.0)
    exact = crumpled.astype(np.float64)
    stretch = np.abs(edge_lengths(exact, MESH.edges) / edge_lengths(MESH.vertices, MESH.edges) - 1)
    assert quality.stretch == pytest.approx(float(np.percentile(stretch, 95)), rel=1e-9, abs=1e-12)
    assert quality.deviation_m == pytest.approx(float(np.sqrt(np.median(np.einsum("nii->n", spread)))), rel=1e-12)
    normals = area_vectors(exact, MESH.faces)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sides = [{*face.tolist()} for face in MESH.faces]
    neighbours = [(f, g) for f in range(len(sides)) for g in range(f) if len(sides[f] & sides[g]) == 2]
    folded = np.mean([normals[f] @ normals[g] < FOLDED_COSINE for f, g in neighbours])
    assert quality.folded_share == pytest.approx(folded)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30), st.floats(0, 1))
def test_percentiles_are_those_of_numpy_and_unknown_with_an_unknown_value(values, share):
    assert percentile(np.array(values), share) == pytest.approx(float(np.quantile(values, share)), abs=1e-9)
    assert np.isnan(percentile(np.array([*values, np.nan]), share))
