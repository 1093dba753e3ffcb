"""Dense synthesis: the samples are the pixels that the mesh covers, and lie on the mesh."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.models.base import Surface
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.synthesis.base import ObservedView
from abs_service.tracker.synthesis.dense import DenseView
from abs_service.tracker.synthesis.projection import Projected, Projection, in_sight
from abs_service.tracker.synthesis.rasterization.texturing import lattice, paint
from abs_service.tracker.synthesis.rasterization.zbuffer import Samples, interpolate, render
from abs_service.tracker.synthesis.sparse import SparseView
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from tests.abs_service.tracker.scenes import CAMERA, as_surface, sheet

PINHOLE = dataclasses.replace(CAMERA, lens=Lens())
MESH = sheet()
seeds = st.integers(0, 2**32 - 1)


def nearest_face(
    place: np.ndarray, inverse_z: np.ndarray, faces: np.ndarray, x: int, y: int
) -> tuple[int, float, np.ndarray, float]:
    """Face at a pixel, its 1/z and barycentric weights there, and the distance of the pixel from the nearest edge."""
    best, nearness, weights, margin = -1, 0.0, np.zeros(3), np.inf
    for f, face in enumerate(faces):
        if np.isnan(inverse_z[face]).any():
            continue
        system = np.vstack([place[face].T, np.ones(3)])
        if abs(np.linalg.det(system)) < 1e-6:
            continue
        share = np.linalg.solve(system, [x, y, 1.0])
        margin = min(margin, float(np.abs(share).min())) if share.min() > -0.05 else margin
        near = float(share @ inverse_z[face])
        if share.min() >= 0 and near > nearness:
            best, nearness, weights = f, near, share * inverse_z[face] / near
    return best, nearness, weights, margin


@settings(max_examples=15)
@given(seeds, st.sampled_from([1, 2, 3]))
def test_the_z_buffer_is_what_its_definition_says(seed, step):
    generator = np.random.default_rng(seed)
    place = generator.uniform(-4, (20, 16), (12, 2)).astype(np.float32)
    inverse_z = generator.uniform(0.5, 2, 12).astype(np.float32)
    inverse_z[generator.integers(12)] = np.nan
    faces = np.array([facing(generator.choice(12, 3, replace=False), place) for _ in range(7)], np.int32)
    ray_length = generator.uniform(1, 1.3, (12, 16)).astype(np.float32)
    samples = render(Projected(place[None], inverse_z[None]), faces, ray_length, step)
    assert np.all(np.diff(samples.pixel[0]) > 0)
    assert samples.covered.tolist() == [len(samples.pixel[0])]
    found = {divmod(int(pixel), 18): i for i, pixel in enumerate(samples.pixel[0])}
    for y in range(0, 12, step):
        for x in range(0, 16, step):
            face, near, weights, margin = nearest_face(place.astype(float), inverse_z, faces, x, y)
            if margin < 1e-3:
                continue  # single precision may differ here
            assert ((y + 1, x + 1) in found) == (face >= 0)
            if face >= 0:
                i = found[y + 1, x + 1]
                assert samples.distance[0, i] == pytest.approx(ray_length[y, x] / near, rel=1e-4)
                if samples.face[0, i] == face:  # where faces intersect, either is correct
                    np.testing.assert_allclose(samples.weights[0, i], weights, atol=2e-3)


@settings(max_examples=20)
@given(seeds)
def test_the_projection_is_eq_10(seed):
    generator = np.random.default_rng(seed)
    vertices = generator.uniform((-0.4, -0.3, -0.5), (0.5, 0.3, 1.6), (60, 3)).astype(np.float32)
    place, inverse_z = Projection(CAMERA).project(np.ascontiguousarray(vertices.T[None]))
    seen = np.isfinite(inverse_z[0])
    local = pose.transform(CAMERA.T_sr, vertices)
    inside = reference_inside(vertices)
    assert np.all(seen[inside])
    assert not seen[local[:, 2] <= 0].any()
    np.testing.assert_allclose(place[0, seen], CAMERA.project(vertices)[seen], atol=2e-3)
    np.testing.assert_allclose(inverse_z[0, seen], 1 / local[seen, 2], rtol=1e-4)
    assert not place[0, ~seen].any()
    low, high = -0.5, np.array([CAMERA.width, CAMERA.height]) - 0.5
    inside = seen & np.all((place[0] >= low) & (place[0] < high), axis=1)
    assert in_sight(Projected(place, inverse_z), (CAMERA.height, CAMERA.width))[0] == pytest.approx(np.mean(inside))


def reference_inside(vertices: np.ndarray) -> np.ndarray:
    """True for points in front of the camera, within its field of view and image."""
    local = pose.transform(CAMERA.T_sr, vertices)
    pixel = CAMERA.project(vertices)
    with np.errstate(invalid="ignore"):
        inside = np.all((pixel >= 0) & (pixel <= (CAMERA.width - 1, CAMERA.height - 1)), axis=1)
    return inside & (local[:, 2] > 0.05) & (np.linalg.norm(local[:, :2], axis=1) < 0.3 * local[:, 2])


def facing(face: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The corners of a face in front-face order: clockwise where y points down."""
    (ax, ay), (bx, by), (cx, cy) = place[face].astype(float)
    return face if (bx - ax) * (cy - ay) < (by - ay) * (cx - ax) else face[::-1]


LATTICE = lattice(MESH, 4)


def view(camera: Camera, step: int = 1) -> ObservedView:
    """The sheet with the coordinates of its points as colours, in cm, in a frame in which it is predicted at rest."""
    made = DenseView(camera, MESH.faces, (LATTICE.vertices * 100).astype(np.float32), step, 4)
    return made.observe(moved([0] * 6))


def moved(*thetas: list[float]) -> Surface:
    """The sheet, rotated and translated."""
    return Rigid(MESH).deform(np.array(thetas))


@pytest.mark.parametrize(("camera", "tolerance"), [(PINHOLE, 1e-3), (CAMERA, 0.02)])
def test_samples_lie_on_the_mesh_and_on_the_centres_of_pixels(camera, tolerance):
    surface = moved([0.2, -0.3, 0.1, 0.01, 0, 0.02])
    seen = view(camera).synthesize(surface)
    assert 700 < seen.pixel.shape[1] < 64 * 48
    assert np.all(seen.pixel > 0)
    points = seen.interpolation.spread(surface.vertices[0].T.astype(float))
    centres = np.stack([seen.pixel[0] % 66 - 1, seen.pixel[0] // 66 - 1], axis=-1)
    assert np.abs(camera.project(points) - centres).max() < tolerance
    np.testing.assert_allclose(seen.distance[0], camera.distance(points), atol=2e-5)
    np.testing.assert_allclose(seen.interpolation.carry(surface.vertices[:, 2])[0], points[:, 2], atol=1e-5)


def test_a_population_is_its_members_one_by_one():
    thetas = [[0.2, -0.3, 0.1, 0.01, 0, 0.02], [0, 0, 0, 0.1, 0, 0], [0, 0, 0, 0, 0, -2.0]]
    together = view(CAMERA).synthesize(moved(*thetas))
    for k, theta in enumerate(thetas):
        alone = view(CAMERA).synthesize(moved(theta))
        count = alone.pixel.shape[1]
        assert np.array_equal(together.pixel[k, :count], alone.pixel[0])
        assert np.all(together.pixel[k, count:] == -1)
        np.testing.assert_allclose(together.distance[k, :count], alone.distance[0])
        np.testing.assert_allclose(together.attributes[k, :, :count], alone.attributes[0])
    assert np.all(together.pixel[2] == -1)  # behind the camera


def test_every_step_th_pixel_is_a_part_of_all():
    surface = moved([0.2, -0.3, 0.1, 0.01, 0, 0.02])
    every, third = (view(CAMERA, step).synthesize(surface) for step in (1, 3))
    place = dict(zip(every.pixel[0].tolist(), every.distance[0].tolist()))
    assert third.pixel.shape[1] == pytest.approx(every.pixel.shape[1] / 9, rel=0.1)
    for pixel, distance in zip(third.pixel[0].tolist(), third.distance[0].tolist()):
        assert place[pixel] == pytest.approx(distance)


def test_the_back_of_a_sheet_is_seen_but_says_nothing():
    turned = view(CAMERA).synthesize(moved([0, np.pi, 0, 0, 0, 0]))
    assert turned.pixel.shape[1] > 700
    assert not turned.pixel.any()


def test_what_lies_behind_the_mesh_itself_is_no_sample():
    """Two sheets of one mesh, one behind the other: only the near one is sampled."""
    vertices = np.concatenate([MESH.vertices, MESH.vertices + np.array([0, 0, 0.2])])
    normals = np.tile((0.0, 0.0, -1.0), (len(vertices), 1))
    faces = np.concatenate([MESH.faces, MESH.faces + len(MESH.vertices)])
    both, surface = np.zeros((2 * len(LATTICE.vertices), 0), np.float32), as_surface((vertices, normals))
    both = DenseView(CAMERA, faces, both, 1, 4).observe(surface).synthesize(surface)
    near = view(CAMERA).synthesize(as_surface((MESH.vertices, normals[: len(MESH.vertices)])))
    shared = np.isin(both.pixel[0], near.pixel[0])
    assert np.count_nonzero(shared) == near.pixel.shape[1]
    np.testing.assert_allclose(both.distance[0, shared], near.distance[0])


def test_interpolation_is_the_weighted_sum_of_the_corners():
    generator = np.random.default_rng(3)
    face = generator.integers(0, len(MESH.faces), (2, 50)).astype(np.int32)
    weights = generator.dirichlet(np.ones(3), (2, 50)).astype(np.float32)
    samples = Samples(np.ones_like(face), np.ones((2, 50), np.float32), face, weights, np.array([50, 50]))
    values = generator.normal(size=(2, len(MESH.vertices), 3)).astype(np.float32)
    corners = MESH.faces[samples.face]
    expected = np.stack([np.einsum("mi,mic->mc", samples.weights[k], values[k][corners[k]]) for k in range(2)])
    np.testing.assert_allclose(interpolate(values, MESH.faces, samples), expected, atol=1e-5)


def test_both_syntheses_see_the_same_surface():
    """Sparse and dense distances agree in the same pixel, up to the slope of the surface within a pixel."""
    surface = moved([0.1, -0.2, 0.1, 0.01, 0, 0.02])
    attributes = np.zeros((len(MESH.vertices), 0), np.float32)
    sparse = SparseView(CAMERA, MESH.faces, attributes).unoccluded(surface).synthesize(surface)
    dense = view(CAMERA).synthesize(surface)
    place = dict(zip(dense.pixel[0].tolist(), dense.distance[0].tolist()))
    pairs = [(place[p], d) for p, d in zip(sparse.pixel[0].tolist(), sparse.distance[0].tolist()) if p in place]
    assert len(pairs) > 80
    assert np.abs(np.diff(pairs, axis=1)).max() < 0.004


def test_the_appearance_is_that_of_the_material_point():
    """The colours are the coordinates of a point on the sheet at rest, for any pose of the sheet."""
    theta = [0.2, -0.3, 0.1, 0.01, 0, 0.02]
    seen = view(CAMERA).synthesize(moved(theta))
    rest = np.ascontiguousarray(MESH.vertices)
    np.testing.assert_allclose(seen.attributes[0].T / 100, seen.interpolation.spread(rest), atol=1e-4)


@settings(max_examples=25)
@given(seeds, st.integers(1, 6))
def test_the_lattice_is_linear_between_its_points(seed, detail):
    """Random colours: a sample's colour is the linear interpolation within its sub-triangle."""
    generator = np.random.default_rng(seed)
    fine = lattice(MESH, detail)
    values = generator.normal(size=(len(fine.vertices), 2)).astype(np.float32)
    face = generator.integers(0, len(MESH.faces), (1, 30)).astype(np.int32)
    weights = generator.dirichlet((1.0, 1.0, 1.0), (1, 30)).astype(np.float32)
    weights[0, :4] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0.5, 0.5]]
    painted = paint(values, detail, Samples(face, np.ones_like(weights[..., 0]), face, weights, np.array([30])))
    per_face = (detail + 1) * (detail + 2) // 2
    for s in range(30):
        corners = MESH.vertices[MESH.faces[face[0, s]]]
        point = weights[0, s].astype(float) @ corners
        mine = slice(face[0, s] * per_face, (face[0, s] + 1) * per_face)
        small = fine.faces[(fine.faces >= mine.start).all(axis=1) & (fine.faces < mine.stop).all(axis=1)]
        assert len(small) == detail**2
        shares = np.array([np.linalg.lstsq(np.vstack([fine.vertices[f].T, np.ones(3)]), [*point, 1])[0] for f in small])
        best = shares.min(axis=1).argmax()  # the sub-triangle that contains the point
        np.testing.assert_allclose(painted[0, :, s], shares[best] @ values[small[best]], atol=2e-3)


def test_the_lattice_lies_on_the_mesh_and_faces_the_same_way():
    fine = lattice(MESH, 3)
    assert fine.area == pytest.approx(MESH.area)
    corners = fine.vertices.reshape(len(MESH.faces), 10, 3)[:, [0, 3, 9]]
    np.testing.assert_allclose(corners, MESH.vertices[MESH.faces])
    assert np.all(fine.normals[:, 2] < -0.5)


def test_neither_covering_more_nor_less_is_worth_anything():
    """A perfect fit has the same cost at any distance; a part outside the image has the cost of unseen samples."""
    dense = view(CAMERA)
    near, far = moved([0, 0, 0, 0, 0, -0.1]), moved([0, 0, 0, 0, 0, 0.1])
    seen = [dense.synthesize(surface) for surface in (near, far)]
    counts = [one.pixel.shape[1] for one in seen]
    assert counts[0] > 1.2 * counts[1]
    costs = [one.interpolation.balance(np.array([2.0 * n]), 7.0)[0] for n, one in zip(counts, seen)]
    assert costs[0] == pytest.approx(costs[1])
    nominal = costs[0] / 2
    half = dense.synthesize(moved([0, 0, 0, 0.21, 0, 0]))  # its right half is outside the image
    assert nominal * 3 < half.interpolation.balance(np.array([2.0 * half.pixel.shape[1]]), 7.0)[0] < nominal * 6
    away = dense.synthesize(moved([0, 0, 0, 2, 0, 0])).interpolation
    assert away.balance(np.zeros(1), 7.0)[0] == pytest.approx(7 * nominal)
