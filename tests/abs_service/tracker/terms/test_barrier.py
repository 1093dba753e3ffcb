"""A light barrier's term: what the mesh crosses is what geometry says, and costs what its errors are worth."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.pairing.images import BeamReading
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracker.terms.barrier import BarrierTerm
from abs_service.tracker.terms.base import Bounds, Prediction
from calib import pose
from calib.camera import Camera
from calib.noise.images.binary import LightBarrier
from calib.rig import Rig, Sensor
from tests import reference
from tests.abs_service.tracker.scenes import as_surface, depth_image, flat, observation, sheet, sparse

LENGTH = 0.8
NOISE = LightBarrier(LENGTH, miss=0.02, false_alarm=0.1)
NO_BOUNDS = Bounds(0.0, 9.0, 99.0)
MESH = sheet(5, 6, flat)
seeds = st.integers(0, 2**32 - 1)


def head(begin: np.ndarray, towards: np.ndarray) -> Camera:
    """The barrier's head: the beam runs along its z axis."""
    return Camera(1, 1, 1.0, 1.0, 0.0, 0.0, T_rs=pose.look_at(begin, towards))


def term(camera: Camera, faces: np.ndarray, noise: LightBarrier = NOISE, bounds: Bounds = NO_BOUNDS) -> BarrierTerm:
    return BarrierTerm("barrier", camera, faces, noise, bounds)


def crossing(barrier: BarrierTerm, surface: Surface) -> list[bool]:
    """True for each mesh that crosses the beam, from the cost of an interruption: 0.02 for a miss, 0.1 for an alarm."""
    return (barrier.observe(BeamReading(True), Prediction(surface)).cost(surface) < 1).tolist()


@given(seeds)
def test_a_beam_is_crossed_where_it_meets_a_face(seed):
    """Against the solution of the linear equations; what single precision may decide otherwise is left out."""
    generator = np.random.default_rng(seed)
    camera = head(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    members = generator.uniform((-0.3, -0.3, -0.2), (0.3, 0.3, 1.2), (12, 6, 3)).astype(np.float32)
    faces = np.array([[0, 1, 2], [5, 4, 3]], np.int32)
    found = crossing(term(camera, faces), as_surface(*((vertices, vertices) for vertices in members)))
    for vertices, crosses in zip(members.astype(float), found):
        met, certain = False, True
        for face in faces:
            s, t, q = reference.meeting_point(np.zeros(3), np.array([0, 0, LENGTH]), vertices[face])
            margin = min(s, t, 1 - s - t, q, 1 - q)
            met |= margin > 0
            certain &= abs(margin) > 1e-4
        assert crosses == met or not certain


@given(seeds, st.sampled_from(["vertex", "edge", "face"]))
def test_there_is_no_crack_between_faces(seed, through):
    """A beam through the inside of a sheet crosses it also where it meets a vertex or an edge exactly."""
    generator = np.random.default_rng(seed)
    inner = [v for v in range(30) if 0 < v % 6 < 5 and 0 < v // 6 < 4]
    corners = {"vertex": MESH.vertices[[generator.choice(inner)]]}
    ends = [edge for edge in MESH.edges if set(edge) & set(inner)]
    corners["edge"] = MESH.vertices[ends[generator.integers(len(ends))]]
    corners["face"] = MESH.vertices[MESH.faces[generator.integers(len(MESH.faces))]]
    shares = generator.dirichlet(np.ones(len(corners[through])))
    target = shares @ corners[through]
    barrier = term(head(target - [*generator.uniform(-0.2, 0.2, 2), 0.4], target), MESH.faces)
    assert crossing(barrier, as_surface((MESH.vertices, MESH.normals))) == [True]


def test_a_beam_ends_at_its_lamp_and_at_its_receiver():
    barrier = term(head(np.zeros(3), np.array([0.0, 0.0, 1.0])), MESH.faces)
    depths = np.array([-1.01, -0.99, -0.21, -0.19])  # of the sheet, which is at 1 m: the beam reaches from 0 to 0.8
    surface = Rigid(MESH).deform(np.column_stack([np.zeros((4, 5)), depths]))
    assert crossing(barrier, surface) == [False, True, True, False]


@given(
    st.builds(LightBarrier, st.just(LENGTH), st.floats(1e-3, 0.49), st.floats(1e-3, 0.49)),
    st.floats(0.01, 0.3),
    st.booleans(),
)
def test_the_cost_is_the_likelihood(noise, share, interrupted):
    """φ is the larger of (1 − ε) P(reading | crossing) and ε ½, as for every other sensor."""
    sensor = Sensor("barrier", head(np.zeros(3), np.array([0.0, 0.0, 1.0])), noise)
    objective = likelihood.Settings(share).build(Rig("r", {"barrier": sensor}), MESH, sparse(sensor.camera, MESH))
    shifts = np.array([[0, 0, 0, 0, 0, -0.5], [0, 0, 0, 0, 0, 0.0]])  # across the beam, and beyond its end
    surface = Rigid(MESH).deform(shifts)
    reading = observation(barrier=BeamReading(interrupted))
    objective = objective.observe(reading, Surface(surface.vertices[:1], surface.normals[:1]))
    right = np.array([1 - noise.miss, 1 - noise.false_alarm])
    agrees = np.array([interrupted, not interrupted])
    density = np.maximum((1 - share) * np.where(agrees, right, 1 - right), share / 2)
    np.testing.assert_allclose(objective.cost(surface), -np.log(density), rtol=1e-9)


@pytest.mark.parametrize("interrupted", [False, True])
def test_in_the_euclidean_fitness_a_contradiction_costs_its_weight(interrupted):
    sensor = Sensor("barrier", head(np.zeros(3), np.array([0.0, 0.0, 1.0])), NOISE)
    weights = euclidean.Settings(barrier_weight=3.5)
    objective = weights.build(Rig("r", {"barrier": sensor}), MESH, sparse(sensor.camera, MESH))
    surface = Rigid(MESH).deform(np.array([[0, 0, 0, 0, 0, -0.5], [0, 0, 0, 0, 0, 0.0]]))
    objective = objective.observe(observation(barrier=BeamReading(interrupted)), surface)
    np.testing.assert_allclose(objective.cost(surface), [0, 3.5] if interrupted else [3.5, 0], atol=1e-12)


def test_it_is_one_sample_that_agrees_or_not_and_has_no_slope():
    barrier = term(head(np.zeros(3), np.array([0.0, 0.0, 1.0])), MESH.faces)
    surface = Rigid(MESH).deform(np.array([[0, 0, 0, 0, 0, -0.5]]))
    for interrupted in (True, False):
        seen = barrier.observe(BeamReading(interrupted), Prediction(surface))
        fit = seen.fit(surface)
        assert (fit.visible, fit.occluded, fit.samples, fit.inliers) == (1, 0, 1, int(interrupted))
        assert fit.mean_log_likelihood == pytest.approx(-NOISE.cost(interrupted)[1])
        assert np.isnan(fit.normalized_residual)
        (linear,) = seen.linearize(surface, SparseJacobian.from_dense(np.zeros((30, 3, 6))))
        assert linear.jacobian.shape == (0, 6)
        assert seen.occluders.shape == (0, 3)


def test_an_image_is_no_reading():
    barrier = term(head(np.zeros(3), np.array([0.0, 0.0, 1.0])), MESH.faces)
    surface = as_surface((MESH.vertices, MESH.normals))
    with pytest.raises(TypeError, match="sensor barrier has noise of a light barrier but delivered DepthImage"):
        barrier.observe(depth_image(np.ones((1, 1))), Prediction(surface))


def test_readings_do_not_depend_on_the_rest_of_the_population():
    barrier = term(head(np.zeros(3), np.array([0.05, 0.02, 1.0])), MESH.faces)
    generator = np.random.default_rng(3)
    surface = Rigid(MESH).deform(generator.uniform(-0.3, 0.1, (16, 6)))
    together = crossing(barrier, surface)
    alone = [
        crossing(barrier, dataclasses.replace(surface, vertices=surface.vertices[k : k + 1]))[0] for k in range(16)
    ]
    assert together == alone
    assert 0 < sum(together) < 16
