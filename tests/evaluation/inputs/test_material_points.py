"""Parts of the figures at material points: bindings to a mesh, 95 % regions, folds, edges and corners."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from abs_service import Status
from evaluation.inputs.recordings import features
from evaluation.inputs.recordings.binding import bind, bind_rays
from evaluation.inputs.recordings.kinect_paper import MaterialErrors, share_inside
from evaluation.inputs.recordings.toy import sponge

SIDE = 0.01


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def sheet() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (81, 3) [m] and faces (128, 3) of a square of 8 × 8 cells, 0.5 m away and a little bent."""
    x, y = np.meshgrid(np.arange(9) * SIDE - 0.04, np.arange(9) * SIDE - 0.04)
    vertices = np.stack([x, y, 0.5 + 2 * x**2], axis=-1).reshape(-1, 3)
    a = np.arange(72).reshape(8, 9)[:, :-1].ravel()
    faces = np.concatenate([np.stack([a, a + 9, a + 1], axis=-1), np.stack([a + 1, a + 9, a + 10], axis=-1)])
    return vertices, faces


def moved(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The vertices after a rigid motion, and its rotation (3, 3) and translation (3,)."""
    rotation, translation = cv2.Rodrigues(np.array([0.3, -0.2, 0.5]))[0], np.array([0.01, 0.02, -0.03])
    return vertices @ rotation.T + translation, rotation, translation


def test_bound_points_are_where_they_were_and_go_where_a_rigid_mesh_takes_them(rng: np.random.Generator) -> None:
    vertices, faces = sheet()
    points = rng.uniform((-0.045, -0.045, 0.49), (0.045, 0.045, 0.51), (200, 3))  # some half a cell beside the mesh
    binding = bind(points, vertices, faces)
    assert binding.bound.all()
    assert binding.points(vertices) == pytest.approx(points, abs=1e-12)
    there, rotation, translation = moved(vertices)
    assert binding.points(there) == pytest.approx(points @ rotation.T + translation, abs=1e-12)


def test_points_on_a_mesh_get_their_own_barycentric_coordinates_back(rng: np.random.Generator) -> None:
    vertices, faces = sheet()
    weights = rng.dirichlet(np.ones(3), len(faces))
    points = np.einsum("kc,kci->ki", weights, vertices[faces])
    binding = bind(points, vertices, faces)
    assert binding.corners == pytest.approx(faces)
    assert binding.weights == pytest.approx(weights, abs=1e-9)
    assert binding.offset == pytest.approx(0, abs=1e-12)


def test_a_point_more_than_a_cell_beside_the_mesh_is_not_bound():
    vertices, faces = sheet()
    z = vertices[4, 2]
    points = np.array([[0.0, 0.0, z], [0.0, 0.04 + 0.8 * SIDE, z], [0.0, 0.04 + 1.6 * SIDE, z]])
    binding = bind(points, vertices, faces)
    assert binding.bound.tolist() == [True, True, False]
    assert len(binding.points(vertices)) == 2


def test_equal_covariances_of_the_vertices_are_those_of_all_points():
    vertices, faces = sheet()
    one = np.diag([1.0, 2.0, 3.0])
    binding = bind(np.array([[0.003, 0.004, 0.5], [0.0, 0.046, 0.5]]), vertices, faces)
    assert binding.covariance(np.broadcast_to(one, (81, 3, 3))) == pytest.approx(np.broadcast_to(one, (2, 3, 3)))


def test_a_ray_is_bound_where_it_meets_the_nearest_face():
    vertices, faces = sheet()
    both = np.concatenate([vertices, vertices * 2])  # a larger one behind it
    rays = np.array([[0.011, -0.017, 0.5], [0.4, 0.0, 0.5]])
    binding = bind_rays(rays, both, np.concatenate([faces + 81, faces]))
    assert binding.bound.tolist() == [True, False]
    point = binding.points(both)[0]
    assert np.cross(point, rays[0]) == pytest.approx(0, abs=1e-12)
    assert point[2] == pytest.approx(0.5, abs=1e-3)


def test_errors_that_are_as_claimed_are_in_their_95_percent_regions_95_times_of_100(rng: np.random.Generator) -> None:
    scales = rng.uniform(0.1, 3, (4000, 3))
    turn = np.linalg.qr(rng.normal(size=(4000, 3, 3)))[0]
    covariance = np.einsum("kij,kj,klj->kil", turn, scales**2, turn)
    error = np.einsum("kij,kj->ki", turn, scales * rng.normal(size=(4000, 3)))
    assert share_inside(error, covariance) == pytest.approx(0.95, abs=0.015)
    assert share_inside(2 * error, covariance) < 0.6
    assert share_inside(error, covariance * np.nan) == 0


def test_a_frame_is_wrong_only_if_it_is_tracking_above_both_bounds():
    one = MaterialErrors(16, Status.TRACKING, 6.0, 9.0, 10.0, 1.0, 0.1, 0.0, 0.0)
    assert one.wrong
    assert not replace(one, status=Status.DEGRADED).wrong
    assert not replace(one, claimed_mm=3.0).wrong  # it says so
    assert not replace(one, median_mm=4.0).wrong
    assert replace(one, claimed_mm=np.nan).wrong


def test_a_corner_that_is_turned_over_is_folded_and_nothing_else():
    vertices, faces = sheet()
    assert not sponge.folded(vertices, vertices, faces).any()
    assert not sponge.folded(moved(vertices)[0], vertices, faces).any()
    over = vertices.copy()
    over[0] = 2 * vertices[10] - vertices[0] + (0, 0, 0.001)  # across the diagonal of its cell
    folded = np.flatnonzero(sponge.folded(over, vertices, faces))
    assert 0 in folded
    assert len(folded) <= 2  # and the neighbour that it lies on


def test_edges_that_stretch_by_a_tenth_say_so():
    vertices, faces = sheet()
    assert sponge.edge_changes(vertices, vertices, faces) == pytest.approx(0)
    assert sponge.edge_changes(1.1 * vertices, vertices, faces) == pytest.approx(0.1)
    assert len(sponge.edge_changes(vertices, vertices, faces)) == 8 * 9 * 2 + 64


def test_corners_follow_an_image_that_moves_and_are_lost_where_they_are_covered(rng: np.random.Generator) -> None:
    blurred = cv2.GaussianBlur(rng.normal(size=(120, 160)), (0, 0), 2)
    texture = (255 * (blurred - blurred.min()) / (blurred.max() - blurred.min())).astype(np.uint8)
    images = [np.roll(texture, k, axis=1) for k in range(4)]
    masks = [np.zeros((120, 160), bool) for _ in images]
    for k, mask in enumerate(masks):
        mask[30:90, 40 + k : 110 + k] = True
    masks[3][30:60] = False
    found = features.tracks(images, masks, features.corners(images[0], masks[0]))
    assert found.shape[1] > 20
    kept = np.isfinite(found[-1, :, 0])
    assert kept == pytest.approx(found[0, :, 1] > 59.5)
    assert found[-1, kept] == pytest.approx(found[0, kept] + (3, 0), abs=0.1)
