"""A posed model is its shape with a rigid motion; the prior fixes the gauge freedom between pose and shape."""

from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service import config, wiring
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models import nurbs, posed
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.models.flexpad import FlexPad
from abs_service.tracker.models.posed import GAUGE_M, Posed
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import euclidean
from abs_service.tracker.posterior.curvature import gauss_newton, search_metric
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.settings import Settings as PriorSettings
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.linearization import Linearization, stack
from abs_service.tracking.session import TrackingSession
from calib import pose
from drivers.simulated.shapes.rectangle import Rectangle
from tests.abs_service.tracker.scenes import sheet
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate, tracked_error_mm

MESH = sheet()
SHAPE = nurbs.Settings((4, 4), 2).of_mesh(MESH)
MODEL = Posed(SHAPE)
RIG = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
T_RP = pose.from_rotation_vector([0, 0, 0], [0, 0, 1.0])
seeds = st.integers(0, 2**32 - 1)


@given(seeds)
def test_the_shape_deforms_and_then_moves_about_the_centroid(seed):
    generator = np.random.default_rng(seed)
    theta = MODEL.rest + generator.normal(0, 0.01, 54)
    theta[:6] = generator.uniform(-1, 1, 6)
    surface, shape = MODEL.deform(theta[None]), SHAPE.deform(theta[None, 6:])
    R = pose.from_rotation_vector(theta[:3], (0, 0, 0))[:3, :3]
    center = SHAPE.mesh.vertices.mean(axis=0)
    expected = (shape.vertices[0].T - center) @ R.T + center + theta[3:6]
    np.testing.assert_allclose(surface.vertices[0].T, expected, atol=1e-6)
    np.testing.assert_allclose(surface.normals[0].T, shape.normals[0].T @ R.T, atol=1e-6)


@given(seeds)
def test_a_pose_changes_no_lengths(seed):
    generator = np.random.default_rng(seed)
    theta = MODEL.rest + generator.normal(0, 0.01, 54)
    theta[:6] = generator.uniform(-1, 1, 6)
    (i, j), posed_at = MODEL.mesh.edges.T, MODEL.deform(theta[None]).vertices[0].T.astype(float)
    shape = SHAPE.deform(theta[None, 6:]).vertices[0].T.astype(float)
    lengths, expected = (np.linalg.norm(v[i] - v[j], axis=1) for v in (posed_at, shape))
    np.testing.assert_allclose(lengths, expected, rtol=0, atol=2e-6)


def test_at_rest_it_is_the_shape_at_rest():
    surface = MODEL.deform(MODEL.rest[None])
    np.testing.assert_allclose(surface.vertices[0].T, SHAPE.mesh.vertices, rtol=0, atol=1e-7)
    assert MODEL.mesh is SHAPE.mesh
    np.testing.assert_array_equal(MODEL.rest[6:], SHAPE.rest)
    np.testing.assert_array_equal(MODEL.scales[6:], SHAPE.scales)
    np.testing.assert_array_equal(MODEL.roughness[:, 6:], SHAPE.roughness)
    assert not MODEL.roughness[:, :6].any()


@dataclass
class Waves:
    """A shape without rigid motions: two waves along x, with a prior."""

    mesh: Mesh = field(default_factory=lambda: MESH)
    rest: np.ndarray = field(default_factory=lambda: np.zeros(2))
    scales: np.ndarray = field(default_factory=lambda: np.ones(2))
    roughness: np.ndarray = field(default_factory=lambda: np.array([[0.0, 2.0]]))
    prior: np.ndarray = field(default_factory=lambda: np.array([[3.0, 4.0]]))

    def deform(self, thetas: np.ndarray) -> Surface:
        waves = np.sin(np.outer([40.0, 60.0], self.mesh.vertices[:, 0]))
        vertices = np.tile(self.mesh.vertices.T, (len(thetas), 1, 1))
        vertices[:, 2] += thetas @ waves
        return Surface(
            vertices.astype(np.float32), np.tile(self.mesh.normals.T, (len(thetas), 1, 1)).astype(np.float32)
        )

    def sparse_jacobian(self, theta: np.ndarray) -> SparseJacobian:
        result = np.zeros((len(self.mesh.vertices), 3, len(theta)))
        result[:, 2] = np.sin(np.outer(self.mesh.vertices[:, 0], [40.0, 60.0]))
        return SparseJacobian.from_dense(result)


@pytest.mark.parametrize(
    ("shape", "known", "rigid"),
    [
        (SHAPE, 0, 6),
        (Rigid(MESH), 0, 6),
        (FlexPad(Sheet(T_RP, 0.3, 0.2), 100, 0.1, 1.0), 9, 6),
        (Posed(Rigid(MESH)), 6, 6),
        (Waves(), 1, 0),
    ],
    ids=["nurbs", "rigid", "flexpad", "posed", "waves"],
)
def test_a_shape_that_can_move_rigidly_is_kept_from_it(shape, known, rigid):
    """One row of the prior per rigid motion that the shape contains, none for others."""
    model = Posed(shape)
    assert model.prior.shape == (known + rigid, 6 + len(shape.rest))
    np.testing.assert_array_equal(model.prior[:, :6], 0)
    np.testing.assert_array_equal(model.prior[:known, 6:], shape.prior)
    assert np.linalg.matrix_rank(model.prior[known:]) == rigid


def test_a_rigid_motion_of_the_shape_costs_what_it_moves_the_vertices():
    moved = MODEL.rest.copy()
    moved[6:] += np.tile([0.0, 3e-4, 4e-4], 16)
    assert np.linalg.norm(MODEL.prior @ (moved - MODEL.rest)) == pytest.approx(5e-4 / GAUGE_M, rel=1e-3)
    moved[6:] = MODEL.rest[6:]
    moved[3:6] = 0.1
    assert not (MODEL.prior @ (moved - MODEL.rest)).any()


def test_what_only_deforms_the_shape_costs_nothing():
    """A bend with zero mean translation and rotation of the vertices."""
    jacobian = SHAPE.sparse_jacobian(SHAPE.rest).dense.reshape(-1, 48)
    x = SHAPE.mesh.vertices[:, 0]
    target = np.column_stack([np.zeros_like(x), np.zeros_like(x), x**2 - np.mean(x**2)]).ravel()
    bend = np.concatenate([np.zeros(6), np.linalg.lstsq(jacobian, target, rcond=None)[0]])
    assert np.abs(MODEL.prior @ bend).max() * GAUGE_M < 0.02 * np.abs(target).max()


def test_the_curvature_is_regular_although_pose_and_shape_can_do_the_same():
    motion = MotionPrior(MODEL.rest, ChangeMetric(MODEL.scales, MODEL.roughness), PriorSettings()).predict(0)
    jacobian = MODEL.sparse_jacobian(MODEL.rest).dense
    measured = jacobian[:, 2] / 5e-3  # every vertex's z, to 5 mm
    parts = StretchPrior(MODEL.mesh, 0.02).linearize(MODEL.deform(MODEL.rest[None]), MODEL.sparse_jacobian(MODEL.rest))
    stretch = stack(parts, 54).jacobian
    rows = np.concatenate([measured, stretch, MODEL.prior, np.linalg.cholesky(motion.precision).T], dtype=np.float64)
    metric = search_metric(gauss_newton([Linearization(np.zeros(len(rows)), rows)], 54))
    np.testing.assert_allclose(metric.T @ rows.T @ rows @ metric, np.eye(54), atol=1e-6)
    deviation = np.sqrt(np.diag(metric @ metric.T))
    assert np.all(deviation[3:5] > 5e-3)  # in the plane of the sheet, only the motion prior constrains the position
    assert deviation[5] < 1e-3


def test_the_motion_of_a_rigid_board_is_all_pose():
    simulation = simulate("simulated://board?seed=1")
    tracker = TrackingSession(rig_of(simulation), default_plan(model=posed.Settings(nurbs.Settings((4, 4), 2))))
    steps = list(drive(tracker, simulation, range(25, 75)))
    assert {step.estimate.status for step in steps} == {Status.TRACKING}
    (board,) = simulation.scene.surfaces
    assert isinstance(board, Rectangle)
    moved = board.motion.at(74 / 30).T_rp @ pose.inverse(board.motion.at(25 / 30).T_rp)
    turn, _ = pose.to_rotation_vector(moved)
    assert tracker.mesh is not None
    center = tracker.mesh.vertices.mean(axis=0)
    theta = steps[-1].estimate.theta
    assert np.linalg.norm(turn) > 0.12
    np.testing.assert_allclose(theta[:3], turn, atol=0.03)
    np.testing.assert_allclose(theta[3:6], pose.transform(moved, center) - center, atol=5e-3)


def loads(model: str) -> config.ServiceConfig:
    """The default rig with another model."""
    before, rest = RIG.split("[trackers.sheet.model]\n")
    after = rest[rest.index("\n\n") :]
    return config.loads(f"{before}[trackers.sheet.model]\n{model}{after}", "rig.toml", Path("/rig"))


def test_a_configuration_nests_the_shape():
    text = 'type = "posed"\n[trackers.sheet.model.shape]\ntype = "nurbs"\ncontrol_points = [5, 3]'
    rig = loads(text)
    assert rig.trackers["sheet"].model == posed.Settings(nurbs.Settings(control_points=(5, 3)))
    assert loads('type = "posed"\nshape = { type = "nurbs", control_points = [5, 3] }') == rig
    assert config.loads(config.to_toml(rig), "again", Path("/elsewhere")) == rig
    assert wiring.model_name(rig, "sheet") == "posed"


@pytest.mark.parametrize(
    ("model", "mistake"),
    [
        ('type = "posed"', "trackers.sheet.model.shape: missing, but needed"),
        (
            'type = "posed"\nshape = { type = "nurbs", degre = 3 }',
            'trackers.sheet.model.shape.degre: unknown key, did you mean "degree"?',
        ),
        (
            'type = "posed"\nshape = { type = "nurbs", degree = 9 }',
            "trackers.sheet.model.shape.degree = 9: must be less than or equal to 4",
        ),
        (
            'type = "posed"\nshape = { type = "nurb" }',
            'trackers.sheet.model.shape.type = "nurb": no such type, did you mean "nurbs"?',
        ),
        (
            'type = "posed"\nshape = { type = "nurbs", control_points = [4, 4], weights = [[1.0, 2.0]] }',
            "weights must be 4 rows of 4 numbers",
        ),
    ],
)
def test_mistakes_of_the_shape_are_told_with_their_full_key(model, mistake):
    with pytest.raises(config.ConfigError) as caught:
        loads(model)
    assert mistake in str(caught.value)


@pytest.mark.slow
def test_the_likelihood_is_within_2_mm_and_not_far_from_squares():
    sequence, model = ("simulated://sheet?seed=1", range(20, 170)), posed.Settings(nurbs.Settings((4, 4), 2))
    likelihood = tracked_error_mm(*sequence, model=model)
    assert likelihood <= 2
    assert likelihood < 1.15 * tracked_error_mm(*sequence, model=model, objective=euclidean.Settings())
