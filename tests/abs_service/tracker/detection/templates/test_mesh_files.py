"""Mesh files that `bind`, the interface of a template, reads or refuses."""

import sys

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import SimpleMaterial

from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.templates import mesh
from abs_service.tracker.models import nurbs, rigid
from calib import pose
from tests.abs_service.tracker.detection.templates.scenes import CAMERA, SIGMA_M, Box, Ellipsoid, Scene

AT = Scene(Box(), pose.from_rotation_vector([0.5, 0.6, 0.3], [0.02, 0.01, 0.7]))
FLAT = Scene(Box((0.15, 0.1, 0.0)), pose.from_rotation_vector([0.1, 0.2, 0.1], [0.0, 0.0, 0.7]))


def detected(scene):
    """The first depth image of a scene."""
    distance = (scene.depth(1) / CAMERA.rays()[..., 2]).astype(np.float32)
    return InitialDetection(np.where(scene.mask(), distance, np.float32(np.nan)), CAMERA, 300, distance, SIGMA_M)


def box():
    return trimesh.creation.box(2 * np.array(Box().half))


def bound(path, vertices=300, scene=AT, **keys):
    """Mesh of the rigid model in the first frame, and its sight."""
    model, sight = mesh.Settings(path, **keys).build(vertices).bind(rigid.Settings(), detected(scene))
    return model.mesh, sight


@pytest.mark.parametrize("ending", ["obj", "ply", "stl"])
def test_a_box_of_eight_vertices_becomes_a_closed_mesh_of_as_many_as_asked_for(tmp_path, ending):
    box().export(tmp_path / f"box.{ending}")
    made = bound(tmp_path / f"box.{ending}")[0]
    body = trimesh.Trimesh(made.vertices, made.faces, process=False)
    assert len(made.vertices) == 300
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume == pytest.approx(box().volume, rel=0.02)
    spacing = np.linalg.norm(body.edges_unique_length) / np.sqrt(len(body.edges_unique))
    assert body.edges_unique_length.max() < 2.0 * spacing
    assert body.edges_unique_length.min() > 0.4 * spacing


def test_a_fine_mesh_becomes_a_coarser_one_with_its_vertices_on_the_surface(tmp_path):
    fine = trimesh.creation.icosphere(5, 1.0).apply_scale(Ellipsoid().half)
    fine.export(tmp_path / "ellipsoid.stl")
    scene = Scene(Ellipsoid(), AT.T_ro)
    made = bound(tmp_path / "ellipsoid.stl", vertices=400, scene=scene)[0]
    assert (len(fine.vertices), len(made.vertices)) == (10242, 400)
    level = np.linalg.norm((made.vertices - made.vertices.mean(axis=0)) @ principal(made) / Ellipsoid().half, axis=1)
    assert level == pytest.approx(1, abs=0.03)


def principal(made):
    """Axes (3, 3) of a mesh as columns, the longest first."""
    return np.linalg.svd(made.vertices - made.vertices.mean(axis=0), full_matrices=False)[2].T


def test_both_sides_of_a_thin_board_have_vertices(tmp_path):
    trimesh.creation.box((0.3, 0.2, 0.004)).export(tmp_path / "board.ply")
    scene = Scene(Box((0.15, 0.1, 0.002)), FLAT.T_ro)
    made = bound(tmp_path / "board.ply", vertices=400, scene=scene)[0]
    assert trimesh.Trimesh(made.vertices, made.faces, process=False).is_watertight
    front = made.normals @ principal(made)[:, 2]
    assert min(np.count_nonzero(front > 0.9), np.count_nonzero(front < -0.9)) > 120


def test_vertices_of_the_file_are_kept_if_they_are_about_as_many_as_asked_for(tmp_path):
    own = box().subdivide(iterations=3)
    own.export(tmp_path / "box.ply")
    made = bound(tmp_path / "box.ply")[0]
    assert (len(made.vertices), len(made.faces)) == (len(own.vertices), len(own.faces))


def test_the_unit_of_the_file_counts(tmp_path):
    small = box().apply_scale(1000)
    small.export(tmp_path / "box.stl")
    made = bound(tmp_path / "box.stl", unit="mm")[0]
    assert np.ptp(made.vertices @ AT.T_ro[:3, :3], axis=0) == pytest.approx(2 * np.array(Box().half), abs=0.004)
    with pytest.raises(DetectionError, match=r'would measure 220.* unit = "m", "cm" or "mm"'):
        mesh.Settings(tmp_path / "box.stl").build(300)


@pytest.mark.parametrize("scene", [AT, Scene(AT.shape, AT.T_ro, board=(0.02, 0.2, -0.2, 0.2))], ids=["open", "hidden"])
def test_only_what_the_first_frame_shows_is_seen(tmp_path, scene):
    box().export(tmp_path / "box.obj")
    made, sight = bound(tmp_path / "box.obj", scene=scene)
    true = visible(scene, made.vertices, made.normals)
    assert np.isnan(sight.colors(made)).all()
    assert np.mean(sight.seen(made)[~true] == 0) > 0.97  # but for those at the rim, within the error of the pose
    assert np.mean(sight.seen(made)[true]) > 0.8


def visible(scene, points, normals):
    """True for points (n, 3) of a surface whose line of sight meets nothing of the scene before."""
    away = np.linalg.norm(points, axis=1)
    place = np.round(CAMERA.project(points)).astype(int)
    return (np.abs(scene.seen()[0][place[:, 1], place[:, 0]] - away) < 0.01) & (np.vecdot(normals, points) < 0)


def test_colours_of_vertices_are_read(tmp_path):
    colored = box().subdivide(iterations=4)
    red = np.where(colored.vertices[:, 0] > 0, 200, 50)
    colored.visual = ColorVisuals(vertex_colors=np.column_stack([red, *2 * [np.full(len(red), 90)]]).astype(np.uint8))
    colored.export(tmp_path / "box.ply")
    made, sight = bound(tmp_path / "box.ply")
    own = pose.transform(pose.inverse(AT.T_ro), made.vertices)
    red = sight.colors(made)[:, 0]
    # A box is its own image when it is turned by 180° about an axis: distances do not tell its ends apart.
    right, left = (red[sign * own[:, 0] > 0.01] for sign in (1, -1))
    assert sorted([np.median(right), np.median(left)]) == [50, 200]
    assert sight.colors(made)[:, 1] == pytest.approx(90, abs=1)


def test_a_texture_is_read_between_the_vertices_of_the_file(tmp_path):
    levels = np.repeat(np.repeat(np.arange(40, 240, 20, dtype=np.uint8)[None, :, None], 8, axis=0), 3, axis=2)
    corners = np.array([[-0.15, -0.1, 0], [0.15, -0.1, 0], [0.15, 0.1, 0], [-0.15, 0.1, 0]])
    material = SimpleMaterial(image=Image.fromarray(levels))
    visual = TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]], material=material)
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False).export(tmp_path / "print.obj")
    made, sight = bound(tmp_path / "print.obj", scene=FLAT)
    along = (made.chart[:, 0] - made.chart[:, 0].min()) / np.ptp(made.chart[:, 0])
    expected = 40 + 20 * np.clip(np.floor(10 * along), 0, 9)
    red = sight.colors(made)[:, 0]
    off = min(np.abs(red - expected).mean(), np.abs(red[::1] - (260 - expected)).mean())
    assert off < 10  # half a step: the nearest sample may lie across a border
    assert np.ptp(red) > 150


def test_a_mesh_without_a_chart_gets_one_and_binds_to_a_spline_surface(tmp_path):
    sheet = trimesh.Trimesh(
        [[-0.15, -0.1, 0], [0.15, -0.1, 0], [0.15, 0.1, 0], [-0.15, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    sheet.export(tmp_path / "sheet.stl")
    model = mesh.Settings(tmp_path / "sheet.stl").build(300).bind(nurbs.Settings(), detected(FLAT))[0]
    assert len(model.rest) == 3 * 6 * 5
    own = pose.transform(pose.inverse(FLAT.T_ro), model.mesh.vertices)
    assert np.abs(own[:, 2]).max() < 0.002
    assert np.mean(np.vecdot(model.mesh.normals, model.mesh.vertices) < 0) == 1  # turned towards the camera


def test_files_that_are_no_surface_are_refused_by_name(tmp_path):
    (tmp_path / "points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    (tmp_path / "noise.stl").write_bytes(b"this is no mesh" * 20)
    flipped = trimesh.Trimesh(box().vertices, np.vstack([box().faces[:1, ::-1], box().faces[1:]]), process=False)
    flipped.export(tmp_path / "flipped.obj")
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False)
    flat.export(tmp_path / "line.obj")
    for name, reason in (
        ("missing.obj", "there is no such file"),
        ("toy.fbx", "the name must end in .obj, .ply, .stl"),
        ("points.ply", "no triangles"),
        ("noise.stl", "path = "),
        ("flipped.obj", "oriented against each other"),
        ("line.obj", "no triangles with an area"),
    ):
        with pytest.raises(DetectionError) as refused:
            mesh.Settings(tmp_path / name).build(300)
        assert f"path = '{tmp_path / name}'" in str(refused.value)
        assert reason in str(refused.value)


def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    box().export(tmp_path / "box.obj")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(DetectionError, match=r"pip install -e '\.\[mesh\]'"):
        mesh.Settings(tmp_path / "box.obj").build(300)
