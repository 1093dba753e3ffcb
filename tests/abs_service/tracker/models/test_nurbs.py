"""The NURBS model is eqs. 2–8: it reproduces the mesh at rest and follows its control points."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import ModelError
from abs_service.tracker.models.nurbs import Nurbs, Settings
from abs_service.tracker.models.parts.binding import bind
from calib import pose
from tests import reference
from tests.abs_service.tracker.scenes import flat, sheet, wave

MESH = sheet()
MODELS = {
    (shape, degree): Settings(control_points=shape, degree=degree).of_mesh(MESH)
    for shape, degree in [((4, 4), 2), ((3, 3), 1), ((5, 4), 3), ((6, 6), 2), ((12, 12), 4)]
}
CASES = pytest.mark.parametrize("case", MODELS, ids=str)
seeds = st.integers(0, 2**32 - 1)


def vectors(maximum: float) -> st.SearchStrategy[np.ndarray]:
    return st.tuples(*[st.floats(-maximum, maximum)] * 3).map(np.array)


def vertices_of(model: Nurbs, theta: np.ndarray) -> np.ndarray:
    return model.deform(theta[None]).vertices[0].T


def order_of(mesh: Mesh, given: Mesh = MESH) -> np.ndarray:
    """Index of the vertex of `mesh` with the same colour, for every vertex of `given`."""
    return np.array([np.flatnonzero((mesh.colors == color).all(axis=1))[0] for color in given.colors])


@CASES
def test_at_rest_the_mesh_is_as_it_was(case):
    model = MODELS[case]
    np.testing.assert_allclose(vertices_of(model, model.rest), model.mesh.vertices, atol=1e-6)
    creased = case[1] == 1  # beside a crease no surface normal reaches some points; a vertex there is moved
    np.testing.assert_allclose(model.mesh.vertices[order_of(model.mesh)], MESH.vertices, atol=2e-4 if creased else 1e-6)


@CASES
def test_only_the_order_of_the_vertices_changes(case):
    mesh, place = MODELS[case].mesh, order_of(MODELS[case].mesh)
    assert sorted(place) == list(range(len(MESH.vertices)))
    assert {tuple(sorted(face)) for face in mesh.faces.tolist()} == {tuple(sorted(place[f])) for f in MESH.faces}
    np.testing.assert_array_equal(mesh.chart[place], MESH.chart)


def bound(control, weights, degree, count, generator):
    """Surface parameters, offsets and the corresponding vertices."""
    u, w = generator.uniform(0.05, 0.95, (2, count))
    offset = generator.uniform(-5e-3, 5e-3, count)
    vertices = np.array([reference.deform(*at, control, weights, degree) for at in zip(u, w, offset)])
    return u, w, offset, vertices


def bent_control(rows=5, columns=4):
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, rows), np.linspace(-0.15, 0.15, columns), indexing="ij")
    return np.stack([x, y, wave(x, y)], axis=-1)


@pytest.mark.parametrize(("degree", "weighted"), [(2, False), (3, False), (2, True), (3, True)])
def test_binding_finds_the_closest_point_and_the_offset(degree, weighted):
    """Eqs. 6 and 7, from an inaccurate initial guess."""
    generator = np.random.default_rng(7)
    weights = generator.uniform(0.5, 2.0, (5, 4)) if weighted else np.ones((5, 4))
    u, w, offset, vertices = bound(bent_control(), weights, degree, 40, generator)
    start = np.clip(np.stack([u, w]) + generator.uniform(-0.05, 0.05, (2, 40)), 0, 1)
    found = bind(vertices, bent_control(), weights, degree, *start)
    np.testing.assert_allclose(found, [u, w, offset], atol=1e-9)


def test_binding_far_from_every_normal_is_an_error():
    control = bent_control()
    with pytest.raises(ModelError, match=r"a vertex is 1\d\d\.\d mm away .* larger margin help"):
        bind(np.array([[0.35, 0.0, 1.0]]), control, np.ones((5, 4)), 2, np.array([0.9]), np.array([0.5]))


@pytest.mark.parametrize(("shape", "degree"), [((4, 4), 2), ((5, 4), 3), ((7, 3), 1), ((6, 6), 4)])
@given(seed=seeds, weighted=st.booleans())
def test_deformation_is_eq_8(shape, degree, seed, weighted):
    generator = np.random.default_rng(seed)
    u, w, offset = *generator.uniform(0, 1, (2, 9)), generator.uniform(-0.02, 0.02, 9)
    mesh = sheet(3, 3)
    rest = bent_control(*shape)
    weights = generator.uniform(0.5, 2.0, shape) if weighted else np.ones(shape)
    model = Nurbs(mesh, rest, weights, degree, u, w, offset)
    control = rest + generator.normal(0, 0.01, rest.shape)
    surface = model.deform(control.reshape(1, -1))
    place = order_of(model.mesh, mesh)
    expected = [reference.deform(*at, control, weights, degree) for at in zip(u, w, offset)]
    normals = [reference.surface_normal(*at, control, weights, degree) for at in zip(u, w)]
    np.testing.assert_allclose(surface.vertices[0].T[place], expected, atol=2e-6)
    np.testing.assert_allclose(surface.normals[0].T[place], normals, atol=2e-4)


def test_offsets_may_be_replaced_at_rest_and_deformed():
    generator = np.random.default_rng(3)
    u, w, (before, after) = *generator.uniform(0, 1, (2, 9)), generator.uniform(-0.02, 0.02, (2, 9))
    mesh, rest, weights = sheet(3, 3), bent_control(5, 4), np.ones((5, 4))
    model, other = (Nurbs(mesh, rest, weights, 2, u, w, offset) for offset in (before, after))
    model.set_offsets(other.offset.astype(float), np.full(9, 1e-3))
    theta = model.rest + generator.normal(0, 0.01, model.rest.shape)
    np.testing.assert_array_equal(vertices_of(model, theta), vertices_of(other, theta))
    np.testing.assert_array_equal(model.sparse_jacobian(theta).dense, other.sparse_jacobian(theta).dense)
    np.testing.assert_array_equal(model.mesh.vertices, other.mesh.vertices)
    np.testing.assert_array_equal(model.mesh.deviation, 1e-3)


@CASES
def test_every_candidate_is_deformed_by_itself(case):
    model = MODELS[case]
    thetas = model.rest + np.random.default_rng(1).normal(0, 0.01, (5, len(model.rest)))
    together = model.deform(thetas)
    for k in range(5):
        alone = model.deform(thetas[k : k + 1])
        np.testing.assert_array_equal(together.vertices[k], alone.vertices[0])
        np.testing.assert_array_equal(together.normals[k], alone.normals[0])


@given(vectors(1.5), vectors(0.3), seeds)
def test_moving_all_control_points_rigidly_moves_the_mesh(rotation, translation, seed):
    model = MODELS[(4, 4), 2]
    T = pose.from_rotation_vector(rotation, translation)
    theta = model.rest + np.random.default_rng(seed).normal(0, 5e-3, len(model.rest))
    surface = model.deform(np.stack([theta, pose.transform(T, theta.reshape(-1, 3)).ravel()]))
    moved = pose.transform(T, surface.vertices[0].T)
    np.testing.assert_allclose(surface.vertices[1].T, moved, atol=3e-6)
    np.testing.assert_allclose(surface.normals[1].T, surface.normals[0].T @ T[:3, :3].T, atol=1e-4)


@CASES
def test_normals_are_of_unit_length_and_face_the_camera(case):
    model = MODELS[case]
    normals = model.deform(model.rest[None]).normals[0].T
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-5)
    assert np.all(np.einsum("ni,ni->n", normals, model.mesh.vertices) < 0)


@pytest.mark.parametrize("mirrored", [False, True])
def test_normals_are_on_the_side_of_the_mesh_s(mirrored):
    """For any orientation of the chart; a mirrored chart does not flip the normals of the surface."""
    mesh = sheet()
    chart = mesh.chart * (-1, 1) if mirrored else mesh.chart
    model = Settings().of_mesh(Mesh(mesh.vertices, mesh.faces, mesh.colors, chart))
    normals = model.deform(model.rest[None]).normals[0].T
    assert np.all(np.einsum("ni,ni->n", normals, model.mesh.normals) > 0.98)


def test_parameters_are_lengths_of_which_there_are_three_per_control_point():
    model = MODELS[(5, 4), 3]
    assert model.rest.shape == model.scales.shape == (60,)
    assert np.all(model.scales == 1)
    control = model.rest.reshape(5, 4, 3)
    # The surface extends beyond the mesh by the margin, and rows of control points follow the long side.
    assert control[0, 0, 0] < -0.15
    assert control[-1, 0, 0] > 0.15
    assert np.ptp(control[..., 0], axis=0).min() > 0.3


@pytest.mark.parametrize(("shape", "degree"), [((3, 3), 3), ((3, 12), 4), ((4, 3), 3)])
def test_too_few_control_points_for_the_degree_are_named(shape, degree):
    few = rf"control_points = \[{shape[0]}, {shape[1]}\] is too few for degree = {degree}: .* at least {degree + 1}"
    with pytest.raises(ModelError, match=few):
        Settings(control_points=shape, degree=degree).of_mesh(MESH)


def test_the_surface_comes_closer_to_a_heavier_control_point():
    """The mesh at rest is reproduced for any weights, because the fit of the control points includes them."""
    gaps = []
    for weight in (0.5, 1.0, 4.0):
        rows = tuple(tuple(weight if (i, j) == (1, 2) else 1.0 for j in range(4)) for i in range(4))
        model = Settings((4, 4), weights=rows).of_mesh(MESH)
        np.testing.assert_allclose(model.mesh.vertices[order_of(model.mesh)], MESH.vertices, atol=1e-6)
        theta = model.rest.copy().reshape(4, 4, 3)
        theta[1, 2, 2] -= 0.1
        gaps.append(np.abs(vertices_of(model, theta.ravel())[:, 2] - model.mesh.vertices[:, 2]).max())
    assert gaps[0] < 0.8 * gaps[1]
    assert gaps[1] < 0.8 * gaps[2]
    assert gaps[2] < 0.1


def test_equal_weights_are_no_weights():
    weighted = Settings(control_points=(3, 5), degree=2, weights=((2.0,) * 5,) * 3).of_mesh(MESH)
    plain = Settings(control_points=(3, 5), degree=2).of_mesh(MESH)
    np.testing.assert_allclose(weighted.rest, plain.rest, atol=1e-9)
    np.testing.assert_array_equal(weighted.mesh.vertices, plain.mesh.vertices)


def test_weights_without_control_points_are_refused():
    with pytest.raises(ValueError, match=r"weights need control_points = \[long, short\]"):
        Settings(weights=((1.0,) * 4,) * 4)


@pytest.mark.parametrize(
    ("rows", "columns", "size", "shape"),
    [
        (13, 19, (0.3, 0.2), (6, 5)),
        (15, 15, (0.2, 0.2), (6, 6)),
        (9, 46, (0.5, 0.1), (6, 4)),
        (7, 9, (0.3, 0.2), (5, 5)),
        (5, 6, (0.3, 0.2), (4, 4)),  # too coarse a mesh for more
    ],
)
def test_control_points_follow_from_the_proportions_and_the_mesh(rows, columns, size, shape):
    mesh = sheet(rows, columns, flat, size)
    for one in (mesh, replace(mesh, chart=mesh.vertices[:, :2])):  # a chart may be in any unit
        assert len(Settings().of_mesh(one).rest) == 3 * shape[0] * shape[1]


@pytest.mark.parametrize(
    ("deviation", "bend", "shape"), [(1e-3, 180, (6, 5)), (5e-3, 180, (5, 4)), (5e-3, 360, (6, 5))]
)
def test_control_points_follow_from_noise_and_bend(deviation, bend, shape):
    mesh = replace(sheet(17, 25, flat), pixel_deviation=deviation)
    model = Settings(bend_deg=bend).of_mesh(mesh)
    assert model.derived == {"control_points": shape, "degree": (3,)}
    assert len(model.rest) == 3 * shape[0] * shape[1]


@pytest.mark.parametrize(("given", "degree"), [((3, 3), 2), ((3, 6), 2), ((4, 4), 3), ((6, 6), 3)])
def test_the_degree_follows_from_given_control_points(given, degree):
    assert Settings(given).of_mesh(MESH).derived == {"control_points": given, "degree": (degree,)}


def test_given_numbers_override_what_is_derived():
    mesh = replace(sheet(17, 25, flat), pixel_deviation=5e-3)
    assert Settings((4, 7), 2).of_mesh(mesh).derived == {"control_points": (4, 7), "degree": (2,)}
    assert Settings(degree=2).of_mesh(mesh).derived["degree"] == (2,)


@pytest.mark.parametrize("weights", [((1.0,) * 4,) * 3, ((1.0,) * 3,) * 4, ((1.0,) * 4, (1.0,) * 3) * 2])
def test_weights_that_are_not_one_per_control_point_are_refused(weights):
    needed = r"4 rows of 4 numbers, one for each of control_points = \[4, 4\], not rows of"
    with pytest.raises(ValueError, match=needed):
        Settings((4, 4), weights=weights)
