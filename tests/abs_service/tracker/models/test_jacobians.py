"""Jacobians of all models match finite differences of the vertices: at rest, bent, and near singular expressions."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.detection.strip.strip_detection import Strip
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.models.flexpad import FULL_HEIGHT, FlexPad
from abs_service.tracker.models.gravity import Gravity
from abs_service.tracker.models.nurbs import Nurbs
from abs_service.tracker.models.parts.arc import SMALL, arc
from abs_service.tracker.models.posed import Posed
from abs_service.tracker.models.rigid import Rigid
from calib import pose
from tests import reference
from tests.abs_service.tracker.models.differences import central_differences, change
from tests.abs_service.tracker.scenes import sheet, wave

MESH = sheet()
SIZE, RADIUS = (0.297, 0.210), 0.1
T_RP = pose.from_rotation_vector([0.2, -0.3, 0.1], [0.05, -0.02, 0.9])
STRIP = Strip(T_RP, 0.3, 0.05, np.linspace(0, 1, 65) ** 2, 0.004)
DOWN = np.array([0.0, 1.0, 0.0])
SURFACE = nurbs.Settings((4, 4), 2).of_mesh(MESH)
FLEXPAD = FlexPad(Sheet(T_RP, *SIZE), 60, RADIUS, 1.0)
MODELS: dict[str, DeformationModel] = {
    "nurbs": SURFACE,
    "nurbs of degree 1": nurbs.Settings(control_points=(3, 4), degree=1).of_mesh(MESH),
    "nurbs of degree 4": nurbs.Settings(control_points=(7, 6), degree=4).of_mesh(MESH),
    "rigid": Rigid(MESH),
    "gravity": Gravity(STRIP, 4, True, 200, DOWN),
    "gravity, held": Gravity(STRIP, 1, False, 100, DOWN),
    "posed nurbs": Posed(SURFACE),
    "twice posed": Posed(Posed(Rigid(MESH))),
}
seeds = st.integers(0, 2**32 - 1)

#: Rounded, because eq. 9 as printed loses all digits where an angle is tiny.
bends = st.lists(st.integers(-1500, 1500), min_size=1, max_size=8).map(lambda milli: np.array(milli) / 1000)


@pytest.mark.parametrize("name", MODELS)
@given(seed=seeds, size=st.sampled_from([0.0, 1e-6, 0.01, 0.02]))
def test_derivatives_are_those_of_deform(name, seed, size):
    """Tolerance: rounding of float32 vertices over a step of 1 mm, per metre of the surface's motion."""
    model = MODELS[name]
    theta = model.rest + size * model.scales * np.random.default_rng(seed).uniform(-1, 1, len(model.rest))
    found = model.sparse_jacobian(theta).dense
    assert found.flags.c_contiguous
    expected = central_differences(model, theta)
    np.testing.assert_allclose(found * model.scales, expected * model.scales, rtol=0, atol=1e-3)


@pytest.mark.parametrize(("shape", "degree"), [((4, 4), 2), ((5, 4), 3), ((7, 3), 1), ((6, 6), 4)])
@given(seed=seeds, weighted=st.booleans(), squeezed=st.sampled_from([1.0, 0.01]))
def test_nurbs_in_double_precision(shape, degree, seed, weighted, squeezed):
    """Includes a surface compressed in one direction until its normals are nearly undefined."""
    generator = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, shape[0]), np.linspace(-0.15, 0.15, shape[1]), indexing="ij")
    rest = np.stack([x, y, wave(x, y)], axis=-1)
    weights = generator.uniform(0.5, 2.0, shape) if weighted else np.ones(shape)
    u, w, offset = *generator.uniform(0, 1, (2, 9)), generator.uniform(-0.02, 0.02, 9)
    mesh = sheet(3, 3)
    model = Nurbs(mesh, rest, weights, degree, u, w, offset)
    at = np.flatnonzero((mesh.colors == model.mesh.colors[0]).all(axis=1))[0]
    theta = ((rest + generator.normal(0, 5e-3, rest.shape)) * [1, squeezed, 1]).ravel()
    direction = generator.standard_normal(theta.size)

    def vertex(theta: np.ndarray) -> np.ndarray:
        return reference.deform(
            float(u[at]), float(w[at]), float(offset[at]), theta.reshape(rest.shape), weights, degree
        )

    found = model.sparse_jacobian(theta).dense[0]
    tolerance = 1e-4 * float(np.linalg.norm(found) * np.linalg.norm(direction))
    np.testing.assert_allclose(found @ direction, change(vertex, theta, direction, 1e-7), rtol=0, atol=tolerance)


@given(seed=seeds, size=st.sampled_from([1e-6, 0.1]))
def test_flexpad_in_double_precision(seed, size):
    """The derivative with respect to a clamped parameter is zero."""
    generator = np.random.default_rng(seed)
    # Bends up to 2.45 and g up to 0.6, but none so close to the limit that a finite difference crosses it.
    theta = size * (generator.integers(-25, 25, 15) + 0.5) / np.repeat([1, 4], [8, 7])
    theta[generator.integers(8)] = 0.0
    direction = FLEXPAD.scales * generator.standard_normal(15)
    places = pose.transform(pose.inverse(T_RP), FLEXPAD.mesh.vertices)[:, :2]
    some = generator.choice(len(places), 5, replace=False)

    def vertices(theta: np.ndarray) -> np.ndarray:
        return np.array([reference.flexpad(theta, place, T_RP, SIZE[0] / 2, RADIUS) for place in places[some]])

    found = FLEXPAD.sparse_jacobian(theta).dense
    np.testing.assert_allclose(found[some] @ direction, change(vertices, theta, direction, 1e-5), rtol=0, atol=1e-5)
    over = np.abs(theta[:9]) > [2.0] * 8 + [FULL_HEIGHT]
    assert not found[:, :, :9][..., over].any()


@given(bends)
@example(np.zeros(4))
@example(np.array([1e-3, -1e-3]))
def test_gravity_in_double_precision(angles):
    shape = Gravity(STRIP, len(angles), False, 100, DOWN)
    flat = shape.deform(np.zeros((1, len(angles)))).vertices[0].T.astype(float)
    places = pose.transform(pose.inverse(T_RP), flat)

    def vertices(angles: np.ndarray) -> np.ndarray:
        return pose.transform(T_RP, reference.gravity(places, angles, STRIP.length))

    found = shape.sparse_jacobian(angles).dense
    for k, direction in enumerate(np.eye(len(angles))):
        np.testing.assert_allclose(found[..., k], change(vertices, angles, direction, 1e-4), rtol=0, atol=1e-5)


@given(st.floats(-7, 7) | st.floats(-2 * SMALL, 2 * SMALL))
def test_an_arc_and_its_derivative_are_integrals(bend):
    nodes, weights = np.polynomial.legendre.leggauss(30)
    t, dt = (nodes + 1) / 2, weights / 2
    turn = np.exp(1j * bend * t)
    end, slope = arc(bend)
    np.testing.assert_allclose([end, slope], [dt @ turn, dt @ (1j * t * turn)], rtol=0, atol=1e-9)
