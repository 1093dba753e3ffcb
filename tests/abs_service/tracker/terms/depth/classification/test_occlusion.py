"""Vertices behind the mesh's own surface, or that face away, are occluded in every candidate of a frame."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.sparse import SparseView
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from tests.abs_service.tracker.scenes import CAMERA, as_surface, flat, plane_distance, sheet


def folded():
    """A sheet whose right third lies 0.1 m before its middle third, facing away."""

    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(x > 0.05, 0.9, 1.0)

    mesh = sheet(9, 31, height)
    vertices = mesh.vertices.copy()
    right = vertices[:, 0] > 0.05
    vertices[right, 0] = 0.1 - vertices[right, 0]
    return type(mesh)(vertices, mesh.faces, mesh.colors, mesh.chart)


def test_a_raster_of_a_plane_is_the_plane():
    normal = np.array([-0.2, 0.1, 1.0])
    mesh = sheet(height=lambda x, y: 1.0 + 0.2 * x - 0.1 * y)
    for lens in (Lens(), Lens(np.array([-0.15, 0.03, 1e-3, -1e-3, 0.005]))):
        camera = Camera(64, 48, 150.0, 152.0, 31.2, 23.9, lens, CAMERA.T_rs)
        distance = Raster(camera, mesh.faces).render(mesh.vertices.T.astype(np.float32))
        inside = np.isfinite(distance)
        assert 0.6 * 45 * 30 < np.count_nonzero(inside) < 1.4 * 45 * 30  # 0.3 × 0.2 m at 150 px and 1 m
        np.testing.assert_allclose(distance[inside], plane_distance(camera, normal, 1.0)[inside], atol=5e-5)


def test_the_nearest_of_two_surfaces_is_seen():
    mesh = folded()
    distance = Raster(CAMERA, mesh.faces).render(mesh.vertices.T.astype(np.float32))
    column, row = np.floor(CAMERA.project(np.array([0.0, 0.0, 1.0])) + 0.5).astype(int)
    assert distance[row, column] < 0.95


def test_what_is_behind_the_camera_is_not_rendered():
    mesh = sheet()
    behind = (mesh.vertices * (1, 1, -1)).T.astype(np.float32)
    assert np.isinf(Raster(CAMERA, mesh.faces).render(behind)).all()


def test_vertices_behind_the_mesh_s_own_surface_and_those_that_face_away_are_no_samples():
    mesh = folded()
    view = SparseView(CAMERA, mesh.faces, mesh.colors)
    surface = as_surface((mesh.vertices, mesh.normals))
    assert (view.unoccluded(surface).synthesize(surface).pixel[0] >= 0).all()
    pixel = view.observe(surface).synthesize(surface).pixel[0]
    x, near = mesh.vertices[:, 0], mesh.vertices[:, 2] < 0.95
    covered = ~near & (x > -0.03) & (x < 0.03) & (np.abs(mesh.vertices[:, 1]) < 0.07)
    assert (pixel[covered] == -1).all()
    assert (pixel[near & (x < 0.03)] == -1).all()  # they face away
    assert (pixel[x < -0.08] > 0).all()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_a_view_that_is_rendered_as_well_hides_the_same_vertices(seed):
    mesh = folded()
    noise = np.random.default_rng(seed).normal(0, 2e-3, mesh.vertices.shape)
    surface = as_surface((mesh.vertices + noise, mesh.normals))
    view = SparseView(CAMERA, mesh.faces, mesh.colors)
    alone, image = view.observe(surface).synthesize(surface), view.render(surface).copy()
    both, rendered = view.observe_rendered(surface)
    np.testing.assert_array_equal(both.synthesize(surface).pixel, alone.pixel)
    np.testing.assert_array_equal(rendered, image)


def test_what_is_hidden_stays_hidden_for_every_candidate_of_the_frame():
    mesh = folded()
    model, view = Rigid(mesh), SparseView(CAMERA, mesh.faces, mesh.colors)
    front = view.observe(model.deform(np.zeros((1, 6))))
    candidates = np.random.default_rng(1).normal(0, 0.02, (5, 6))
    pixel = front.synthesize(model.deform(candidates)).pixel
    assert np.array_equal(pixel < 0, np.broadcast_to(pixel[0] < 0, pixel.shape))
    back = view.observe(model.deform(np.array([[np.pi, 0, 0, 0, 0, 0.0]])))
    assert not np.array_equal(back.synthesize(model.deform(candidates)).pixel[0] < 0, pixel[0] < 0)
    np.testing.assert_array_equal(front.synthesize(model.deform(candidates)).pixel, pixel)


def test_an_open_sheet_hides_nothing_from_any_side():
    mesh = sheet(height=flat)
    surface = as_surface((mesh.vertices, mesh.normals))
    for x in np.linspace(-0.6, 0.6, 7):
        camera = Camera(64, 48, 150.0, 152.0, 31.2, 23.9, T_rs=pose.look_at([x, 0.1, 0.0], [0.0, 0.0, 1.0]))
        view = SparseView(camera, mesh.faces, mesh.colors).observe(surface)
        assert (view.synthesize(surface).pixel > 0).all()
