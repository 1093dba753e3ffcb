"""Quantities of a mesh's vertices and their colours."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.display.page.scene import fields
from abs_service.display.page.scene.fields import FIELDS, GREY, ColorScale, MeshView
from calib.camera import Camera

CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)


def grid(z) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (81, 3) of z(x, y) on 16 × 16 cm and faces whose normals point to the camera."""
    x, y = np.meshgrid(np.linspace(-0.08, 0.08, 9), np.linspace(-0.08, 0.08, 9))
    number = np.arange(81).reshape(9, 9)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    return np.stack([x, y, z(x, y)], axis=-1).reshape(-1, 3), faces.astype(np.int32)


def view(vertices, faces, first=None, covariance=None, measured=None) -> MeshView:
    covariance = np.empty((0, 6)) if covariance is None else covariance
    camera = None if measured is None else CAMERA
    measured = np.empty((0, 0)) if measured is None else measured
    return MeshView(vertices, vertices if first is None else first, faces, covariance, measured, camera)


def test_several_meshes_are_drawn_as_one():
    vertices, faces = grid(lambda x, y: 1 + 0 * x)
    known = replace(view(vertices + 1.0, faces), rim=bytes([3] * len(vertices)))
    both, sides, classes = fields.joined([view(vertices, faces), known])
    assert classes.tolist() == [0] * len(vertices) + [3] * len(vertices)
    np.testing.assert_array_equal(both[sides[len(faces) :]], vertices[faces] + 1.0)
    np.testing.assert_array_equal(both[sides[: len(faces)]], vertices[faces])
    assert [part.shape for part in fields.joined([])] == [(0, 3), (0, 3), (0,)]


def test_displacement_is_the_distance_from_the_first_pose():
    vertices, faces = grid(lambda x, y: 1 + 0 * x)
    np.testing.assert_allclose(fields.displacement(view(vertices + np.array([0.003, 0, 0.004]), faces, vertices)), 5.0)


def test_sigma_is_the_root_of_the_trace_and_unknown_without_covariance():
    vertices, faces = grid(lambda x, y: 1 + 0 * x)
    covariance = np.tile([1e-6, 5.0, 5.0, 4e-6, 5.0, 4e-6], (81, 1))
    np.testing.assert_allclose(fields.sigma(view(vertices, faces, covariance=covariance)), 3.0)
    assert np.isnan(fields.sigma(view(vertices, faces))).all()


@pytest.mark.parametrize(("side", "sign"), [(1, 1), (-1, -1)])
def test_curvature_of_a_sphere_is_one_over_its_radius(side, sign):
    vertices, faces = grid(lambda x, y: 1 - side * (np.sqrt(0.25 - x**2 - y**2) - 0.5))
    inner = np.arange(81).reshape(9, 9)[2:-2, 2:-2].ravel()
    np.testing.assert_allclose(fields.curvature(view(vertices, faces))[inner], sign / 0.5, rtol=0.1)


def test_residual_is_measured_minus_expected_and_unknown_off_the_image_and_without_return():
    vertices, faces = grid(lambda x, y: 1 + 0 * x)
    vertices[80] = 10.0, 0.0, 1.0
    measured = np.full((30, 40), np.nan)
    column, row = np.floor(CAMERA.project(vertices[:40]) + 0.5).astype(int).T
    measured[row, column] = CAMERA.distance(vertices[:40]) + 0.002
    found = fields.residual(view(vertices, faces, measured=measured))
    assert np.nanmedian(found) == pytest.approx(2.0, abs=1.0)
    assert np.isnan(found[[70, 80]]).all()
    assert np.isnan(fields.residual(view(vertices, faces))).all()


def test_colours_reach_from_the_first_to_the_last_and_are_grey_where_nothing_is_known():
    for field in FIELDS.values():
        scale = ColorScale(field)
        shown = scale.colors(np.array([0.0, 2.0, np.nan]))
        table = fields.PALETTES[field.signed]
        np.testing.assert_array_equal(shown, [table[127 if field.signed else 0], table[255], GREY])
        assert scale.end == 2.0


def test_the_scale_grows_at_once_and_falls_slowly():
    scale = ColorScale(FIELDS["displacement"])
    scale.colors(np.full(5, 40.0))
    scale.colors(np.full(5, 1.0))
    assert scale.end == 50.0
    for _ in range(400):
        scale.colors(np.full(5, 1.0))
    assert scale.end == 1.0


@pytest.mark.parametrize(("value", "end"), [(0.9, 1.0), (1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (0.06, 0.1), (7e3, 1e4)])
def test_the_end_of_a_scale_is_a_round_number(value, end):
    assert fields.nice(value) == pytest.approx(end)
