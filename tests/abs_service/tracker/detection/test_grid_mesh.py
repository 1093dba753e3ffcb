"""The initial mesh covers the object in the reference sensor, and nothing else."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from abs_service.pairing.images import ColorImage
from abs_service.tracker.detection.grid_mesh import MIN_VERTICES, grid_mesh
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.detection.segmentation import detect_object
from calib import pose
from calib.camera import Camera
from calib.noise.images.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import depth_image, observation

TOF = Camera(176, 144, 220.0, 220.0, 87.5, 71.5, T_rs=pose.from_rotation_vector([0.1, -0.2, 0.05], [0.1, 0.2, -0.3]))
COLOR = Camera(320, 240, 275.0, 275.0, 159.5, 119.5, T_rs=TOF.T_rs @ pose.from_rotation_vector([0, 0, 0], [0.05, 0, 0]))
RIG = Rig("r", {"tof": Sensor("tof", TOF, StructuredLight()), "color": Sensor("color", COLOR, GaussianColor())})
WIDTH, HEIGHT = 0.30, 0.20


def rectangle(T_ro: np.ndarray, background: float = np.nan) -> np.ndarray:
    """Distances of a rectangle of 0.30 × 0.20 m in the x-y plane of o, in front of an equidistant background."""
    T_os = pose.inverse(T_ro) @ TOF.T_rs
    rays = TOF.rays() @ T_os[:3, :3].T
    distance = -T_os[2, 3] / rays[..., 2]
    x, y = (T_os[i, 3] + distance * rays[..., i] for i in range(2))
    inside = (np.abs(x) < WIDTH / 2) & (np.abs(y) < HEIGHT / 2) & (distance > 0)
    return np.where(inside, distance, background).astype(np.float32)


def placed(turn: float = 0.0, tilt: float = 0.0, z: float = 1.0) -> np.ndarray:
    """Pose in the rig of a rectangle in front of the camera, rotated about its normal and tilted [rad]."""
    T_so = pose.from_rotation_vector([0, 0, 0], [0.01, -0.02, z]) @ pose.from_rotation_vector(
        [tilt, tilt / 2, 0], [0] * 3
    )
    return TOF.T_rs @ T_so @ pose.from_rotation_vector([0, 0, turn], [0, 0, 0])


def area(mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


TURNS = np.deg2rad([0, 20, 45, 70, 90, 135])


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_the_mesh_is_the_rectangle(turn, tilt):
    T_ro = placed(turn, tilt)
    mesh = grid_mesh(InitialDetection(rectangle(T_ro), TOF, 300))
    points = pose.transform(pose.inverse(T_ro), mesh.vertices)
    np.testing.assert_allclose(points[:, 2], 0, atol=5e-4)  # in the plane
    assert np.abs(points[:, 0]).max() < WIDTH / 2 + 0.006  # a pixel is 4.5 mm wide
    assert np.abs(points[:, 1]).max() < HEIGHT / 2 + 0.006
    # No vertex lies closer to the rim than its neighbourhood reaches.
    assert 0.72 * WIDTH * HEIGHT < area(mesh) < 1.02 * WIDTH * HEIGHT
    assert 0.75 * 300 < len(mesh.vertices) < 1.15 * 300


@pytest.mark.parametrize("z", np.linspace(0.85, 1.15, 7))
def test_the_mesh_ends_half_a_cell_inside_every_side(z):
    mesh = grid_mesh(InitialDetection(rectangle(placed(z=z)), TOF, 300))
    on_object = pose.transform(pose.inverse(placed(z=z)), mesh.vertices)[:, :2]
    margin = np.array([WIDTH, HEIGHT]) / 2 - np.abs(on_object).max(axis=0)
    cell, pixel = np.sqrt(WIDTH * HEIGHT / 300), z / TOF.fx
    np.testing.assert_allclose(margin, cell / 2, atol=0.1 * cell + pixel)


@pytest.mark.parametrize("vertices", [60, 150, 300, 1000])
def test_there_are_about_as_many_vertices_as_wanted(vertices):
    mesh = grid_mesh(InitialDetection(rectangle(placed()), TOF, vertices))
    assert len(mesh.vertices) == pytest.approx(vertices, rel=0.2)
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)  # no unused vertices


@pytest.mark.parametrize("turn", TURNS)
def test_faces_are_seen_from_the_camera_and_the_chart_follows_the_long_side(turn):
    T_ro = placed(turn, 0.2)
    mesh = grid_mesh(InitialDetection(rectangle(T_ro), TOF, 200))
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.einsum("ni,ni->n", normals, corners[:, 0] - TOF.center) < 0)
    chart = mesh.chart[mesh.faces]
    sides = np.concatenate([chart[:, 1] - chart[:, 0], chart[:, 2] - chart[:, 0]])
    assert np.abs(sides).max() == 1  # neighbours on the grid
    assert np.linalg.det(np.stack([chart[:, 1] - chart[:, 0], chart[:, 2] - chart[:, 0]], axis=1)).max() < 0
    along = pose.transform(pose.inverse(T_ro), mesh.vertices)[:, 0]
    assert abs(np.corrcoef(along, mesh.chart[:, 0])[0, 1]) > 0.9


def test_noise_is_averaged():
    distance = rectangle(placed())
    noisy = distance + np.random.default_rng(1).normal(0, 5e-3, distance.shape).astype(np.float32)
    points = pose.transform(pose.inverse(placed()), grid_mesh(InitialDetection(noisy, TOF, 300)).vertices)
    assert points[:, 2].std() < 3e-3


def test_a_steep_plane_has_vertices_though_its_cells_are_large():
    """A table that fills the image, seen at 60°: distances around a vertex differ by more than its relief may."""
    cosine, normal = 0.5, np.array([0.0, np.sqrt(0.75), 0.5])
    distance = (cosine / (TOF.rays() @ normal)).astype(np.float32)
    mesh, fine = (grid_mesh(InitialDetection(distance, TOF, vertices)) for vertices in (300, 2000))
    assert area(mesh) > 0.9 * area(fine)
    off = pose.transform(TOF.T_sr, mesh.vertices) @ normal - cosine
    assert np.abs(off).max() < 5e-3


def test_no_face_spans_a_jump_in_distance():
    """A step of 20 cm between the halves: no gap in the image, but two surfaces."""
    near, far = rectangle(placed()), rectangle(placed(z=1.2))
    distance = near.copy()
    distance[:, 90:] = far[:, 90:]
    mesh = grid_mesh(InitialDetection(distance, TOF, 200))
    z = pose.transform(TOF.T_sr, mesh.vertices)[:, 2]
    assert np.ptp(z[mesh.faces], axis=1).max() < 0.02
    assert z.min() < 1.02
    assert z.max() > 1.18


FINE = Camera(320, 240, 275.0, 275.0, 160.0, 120.0)
COLUMN, ROW = np.meshgrid(np.arange(FINE.width, dtype=float), np.arange(FINE.height, dtype=float))
BLOCK = (np.abs(COLUMN - 160) < 30) & (np.abs(ROW - 120) < 28)


def fine_mesh(z: np.ndarray, seed: int):
    """Mesh with cells of 2.4 px, 5 mm, of an object with these z (height, width) [m], measured with 0.5 mm of noise."""
    noisy = z + 0.5e-3 * np.random.default_rng(seed).standard_normal(z.shape)
    distance = np.where(BLOCK, noisy, np.nan) * FINE.lookup.ray_length
    return grid_mesh(InitialDetection(distance.astype(np.float32), FINE, 600))


@pytest.mark.parametrize("step", [0.032, 0.04, 0.06])
@pytest.mark.parametrize("place", range(12))
def test_two_surfaces_are_apart_wherever_their_jump_lies_between_the_pixels(step, place):
    """Vertices at a jump are means of both surfaces, and may make a staircase of it."""
    turn = 0.25 * place
    far = (ROW - 119 - 0.37 * place) * np.cos(turn) + (COLUMN - 160) * np.sin(turn) < 0
    mesh = fine_mesh(0.6 + step * far, place)
    z, edges = mesh.vertices[:, 2], mesh.edges
    part = connected_components(coo_array((np.ones(len(edges)), edges.T), shape=(len(z), len(z))), directed=False)[1]
    near, beyond = (set(part[np.abs(z - level) < 0.1 * step]) for level in (0.6, 0.6 + step))
    assert near
    assert beyond
    assert not near & beyond


@pytest.mark.parametrize("slant", [0, 45, 60, 70])
def test_a_plane_has_no_jumps_however_it_is_slanted(slant):
    slope = np.tan(np.deg2rad(slant)) * (ROW - 120) / FINE.fy
    faces = len(fine_mesh(0.6 / np.maximum(1 - slope, 0.5), 1).faces)
    assert faces > 0.98 * len(fine_mesh(np.full(ROW.shape, 0.6), 1).faces)


def test_a_hole_in_the_object_is_a_hole_in_the_mesh():
    distance = rectangle(placed())
    distance[60:85, 75:100] = np.nan
    mesh = grid_mesh(InitialDetection(distance, TOF, 400))
    centers = TOF.project(mesh.vertices[mesh.faces].mean(axis=1))
    assert not np.any(np.all((centers > (78, 63)) & (centers < (96, 81)), axis=1))


def test_too_little_of_an_object_is_an_error():
    distance = np.full((144, 176), np.nan, np.float32)
    distance[70, 60:100] = 1.0
    with pytest.raises(DetectionError, match=rf"too small in the depth image: \d+ vertices, {MIN_VERTICES} needed"):
        grid_mesh(InitialDetection(distance, TOF, 100))


def test_an_object_of_a_single_pixel_is_an_error():
    distance = np.full((144, 176), np.nan, np.float32)
    distance[70, 60] = 1.0
    with pytest.raises(DetectionError, match="too small"):
        grid_mesh(InitialDetection(distance, TOF, 100))


def test_nothing_in_sight_is_an_error():
    nothing = observation(tof=depth_image(np.full((144, 176), np.nan)))
    with pytest.raises(DetectionError, match="no connected surface"):
        detect_object(nothing, RIG, "tof", nearest.Settings().build(), 300)


def test_without_a_depth_image_there_is_no_mesh_yet():
    for seen in (observation(), observation(color=gradient_image())):
        with pytest.raises(DetectionError, match="no depth image from tof yet"):
            detect_object(seen, RIG, "tof", nearest.Settings().build(), 300)


def gradient_image() -> ColorImage:
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    return ColorImage(np.stack([columns // 2, rows, 255 - rows], axis=-1).astype(np.uint8))
