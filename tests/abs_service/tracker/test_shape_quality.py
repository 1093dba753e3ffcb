"""Quality of a deformed mesh, without measurements."""

import numpy as np
import pytest

from abs_service.tracker.shape_quality import ShapeComparison
from tests.abs_service.tracker.scenes import flat, sheet

MESH = sheet(9, 13, flat)


def covariances(sigma: float) -> np.ndarray:
    return np.tile(sigma**2 * np.eye(3), (len(MESH.vertices), 1, 1))


def test_a_mesh_at_rest_is_neither_stretched_nor_folded():
    quality = ShapeComparison(MESH).compare(MESH.vertices, covariances(2e-3), 0.0)
    assert (quality.stretch, quality.folded_share) == (pytest.approx(0, abs=1e-9), 0)
    assert quality.deviation_m == pytest.approx(np.sqrt(3) * 2e-3)


def test_stretch_is_the_relative_change_of_the_edges():
    quality = ShapeComparison(MESH).compare(MESH.vertices * (1.1, 1.1, 1.0), covariances(1e-3), 0.0)
    assert quality.stretch == pytest.approx(0.1)


def test_a_sheet_that_is_folded_in_half_has_folded_faces_along_one_line_only():
    half = MESH.vertices.copy()
    right = half[:, 0] > 1e-6
    half[right, 0] *= -1
    half[right, 2] += 1e-3
    folded = ShapeComparison(MESH).compare(half, covariances(1e-3), 0.0).folded_share
    assert 0 < folded < 0.1


def test_bending_is_no_fold():
    roll = MESH.vertices.copy()
    roll[:, 0], roll[:, 2] = 0.1 * np.sin(roll[:, 0] / 0.1), 1.1 - 0.1 * np.cos(roll[:, 0] / 0.1)
    assert ShapeComparison(MESH).compare(roll, covariances(1e-3), 0.0).folded_share == 0
