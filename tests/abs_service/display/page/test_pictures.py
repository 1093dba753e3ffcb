"""Points from depth frames of either geometry, and meshes drawn over pictures."""

import json

import numpy as np
import pytest

from abs_service.display.page import pictures
from abs_service.display.page.scene.gltf import glb
from calib.camera import Camera
from drivers.contract.frame import Frame, Geometry, Kind

#: Turned by 90° about z and shifted, so that a pose that is left out shows.
T_RS = np.array([[0.0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, T_rs=T_RS)

FACES = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def depth(values, geometry) -> Frame:
    """A depth frame in half millimetres."""
    data = np.asarray(np.round(np.asarray(values) * 2000), "<u2")
    return Frame("tof", "depth", Kind.DEPTH, data, "16UC1", 1, 1, 1, scale=0.0005, geometry=geometry, invalid=0)


def plane_points() -> np.ndarray:
    """Rig points (height, width, 3) of the plane z = 2 m before the camera."""
    return CAMERA.unproject(2.0 / CAMERA.rays()[..., 2])


def test_points_of_a_plane_are_the_same_from_either_geometry():
    z = np.full((48, 64), 2.0)
    z[:, 10] = 0
    radial = z / CAMERA.rays()[..., 2]
    for frame in (depth(z, Geometry.Z), depth(radial, Geometry.RADIAL)):
        found, pixels, spacing_m = pictures.cloud(pictures.radial(frame, CAMERA), CAMERA)
        assert len(found) == 48 * 63
        assert 10 not in pixels[:, 1]
        np.testing.assert_allclose(found, plane_points()[pixels[:, 0], pixels[:, 1]], atol=6e-4)
        assert spacing_m == pytest.approx(2 / 60, rel=0.2)


def test_large_images_are_thinned_out(monkeypatch):
    monkeypatch.setattr(pictures, "POINTS", 200)
    found, pixels, _ = pictures.cloud(np.full((48, 64), 2.0), CAMERA)
    assert len(found) <= 200
    assert (pixels % 4 == 0).all()


def test_a_ray_meets_the_pixel_that_it_was_cast_through_in_front_of_all_behind():
    distance = np.full((48, 64), 2.0)
    distance[20:30, 20:40] = 1.0
    points, pixels, spacing_m = pictures.cloud(distance, CAMERA)
    for target in ([25, 30], [20, 20], [5, 50]):
        point = CAMERA.unproject(distance)[tuple(target)]
        for eye in (CAMERA.center, point + np.array([0.2, -0.1, -1.5])):
            direction = (point - eye) / np.linalg.norm(point - eye)
            found = pictures.under_ray(points, eye, direction, 1.5 * spacing_m)
            assert found is not None
            np.testing.assert_allclose(pixels[found], target, atol=1)
    assert pictures.under_ray(points, CAMERA.center, -CAMERA.T_rs[:3, 2], 1.5 * spacing_m) is None
    assert pictures.under_ray(np.empty((0, 3)), CAMERA.center, CAMERA.T_rs[:3, 2], 0.1) is None


def test_an_image_without_any_return_has_no_points():
    assert len(pictures.cloud(np.full((48, 64), np.nan), CAMERA)[0]) == 0


def test_the_rim_is_drawn_where_the_camera_sees_it():
    corners = plane_points()[[12, 12, 36, 36], [16, 48, 16, 48]]
    drawn = pictures.with_mesh(np.zeros((48, 64, 3), np.uint8), CAMERA, corners, FACES)
    assert drawn.shape == (360, 480, 3)
    factor = pictures.WIDTH / 64
    rim = np.argwhere((drawn == pictures.RIM[0]).all(axis=2))
    low, high = rim.min(axis=0), rim.max(axis=0)
    np.testing.assert_allclose([*low, *high], factor * (np.array([12, 16, 36, 48]) + 0.5) - 0.5, atol=2)


def test_the_rim_has_the_colours_of_its_classes():
    corners = plane_points()[[12, 12, 36, 36], [16, 48, 16, 48]]
    image = np.zeros((48, 64, 3), np.uint8)
    colors = []
    for number in range(6):
        classes = np.array([number, number, 0, 0], np.uint8)  # of the side above, and what meets it
        drawn = pictures.with_mesh(image, CAMERA, corners, FACES, classes)
        colors.append({tuple(color) for color in drawn.reshape(-1, 3).tolist()} & {*pictures.RIM})
    free, others = pictures.RIM[0], pictures.RIM[2:]
    assert colors == [{free}, {free}, *({free, other} for other in others)]
    unknown = pictures.with_mesh(image, CAMERA, corners, FACES, np.full(4, 99, np.uint8))
    np.testing.assert_array_equal(unknown, pictures.with_mesh(image, CAMERA, corners, FACES))


def test_what_is_behind_the_camera_is_not_drawn():
    behind = plane_points()[[12, 12, 36, 36], [16, 48, 16, 48]] - (0, 0, 9)
    assert not pictures.with_mesh(np.zeros((48, 64, 3), np.uint8), CAMERA, behind, FACES).any()


def test_faces_have_the_mean_colour_of_their_corners_and_those_without_a_value_are_grey():
    corners = plane_points()[[12, 12, 36, 36], [16, 48, 16, 48]]
    asked = []

    def color(values):
        asked.append(values.tolist())
        return np.full((len(values), 3), (200, 30, 0), np.uint8)

    values = np.array([1.0, 2.0, 6.0, np.nan])
    drawn = pictures.with_colors(np.full((48, 64, 3), 90, np.uint8), CAMERA, corners, FACES, values, color)
    assert asked == [[3.0]]
    assert drawn.shape == (360, 480, 3)
    factor = pictures.WIDTH / 64
    assert drawn[int(16 * factor), int(20 * factor)].tolist() == [200, 30, 0]
    assert drawn[int(34 * factor), int(44 * factor)].tolist() == [85] * 3  # grey of the image: 90 / 2 + 40


def test_the_nearer_of_two_faces_is_on_top():
    far = plane_points()[[12, 12, 36], [16, 48, 16]]
    eye = CAMERA.center
    vertices = np.concatenate([eye + 0.5 * (far - eye), far])
    faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    image, values = np.zeros((48, 64, 3), np.uint8), np.array([7.0] * 3 + [9.0] * 3)
    drawn = pictures.with_colors(
        image, CAMERA, vertices, faces, values, lambda v: np.repeat(v[:, None], 3, 1).astype("u1")
    )
    assert drawn[int(16 * 7.5), int(20 * 7.5), 0] == 7


def test_pictures_show_distances_in_colours_and_no_return_in_its_own():
    z = np.tile(np.linspace(1, 2, 64), (48, 1))
    z[5] = 0
    shown = pictures.picture(depth(z, Geometry.Z))
    assert (shown[5] == pictures.NO_RETURN).all()
    assert shown[10, 0, 0] > shown[10, -1, 0]  # near is red
    grey = pictures.grey(shown)
    assert (grey[..., 0] == grey[..., 2]).all()


def test_colour_images_are_shown_as_they_are_and_in_the_right_order():
    data = np.zeros((4, 4, 3), np.uint8)
    data[..., 0] = 200
    for encoding, channel in (("rgb8", 0), ("bgr8", 2)):
        shown = pictures.picture(Frame("color", "color", Kind.COLOR, data, encoding, 1, 1, 1))
        assert (shown[..., channel] == 200).all()
        assert shown.sum() == 16 * 200


def test_rim_edges_belong_to_one_face():
    assert pictures.rim_edges(FACES).tolist() == [[0, 1], [0, 2], [1, 3], [2, 3]]


def test_a_mesh_file_can_be_read_by_others():
    trimesh = pytest.importorskip("trimesh")
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]])
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]], np.uint8)
    data = glb(vertices, FACES, colors)
    scene = trimesh.load(trimesh.util.wrap_as_stream(data), file_type="glb")
    mesh, _ = scene.geometry.values()
    np.testing.assert_allclose(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, FACES)
    np.testing.assert_array_equal(mesh.visual.vertex_attributes["color"][:, :3], colors)


def test_a_mesh_file_has_every_edge_as_a_line():
    data = glb(np.eye(4, 3), FACES, np.zeros((4, 3), np.uint8))
    text_size = int.from_bytes(data[12:16], "little")
    document, binary = json.loads(data[20 : 20 + text_size]), data[28 + text_size :]
    net = document["meshes"][0]["primitives"][1]
    view = document["bufferViews"][document["accessors"][net["indices"]]["bufferView"]]
    ends = np.frombuffer(binary[view["byteOffset"] :][: view["byteLength"]], "<u4").reshape(-1, 2)
    assert net["mode"] == 1
    assert ends.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
