"""Messages of an estimate."""

from dataclasses import replace

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState

from abs_service.pairing.observation import Source
from abs_service.tracker.estimates.estimate import Estimate, SearchReport, Status
from abs_service.tracker.estimates.shape_quality import ShapeQuality
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.optimizers.base import Stop
from abs_service.tracker.terms.sensor_fit import Remainder, RimFit, SensorFit
from abs_service.tracker.terms.vertex_counts import VertexCounts
from abs_service.wire import estimate_messages
from abs_service.wire.estimate_messages import Effort, Identity

ESTIMATE = Estimate(
    seq=7,
    t_host_ns=10**9,
    status=Status.DEGRADED,
    reasons=("no frame from color",),
    theta=np.array([1.0, 2.0, 3.0]),
    covariance=np.array([[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]]),
    vertices=np.arange(6, dtype=np.float32).reshape(2, 3),
    vertex_covariance=np.array([[[1.0, 2, 3], [2, 4, 5], [3, 5, 6]], [[7.0, 0, 0], [0, 8, 0], [0, 0, 9]]]),
    search=SearchReport(
        cost=12.5, deviation=0.5, searcher="cma_es", stop=Stop.TIME, generations=3, evaluations=45, limit=1000
    ),
    fits=(
        SensorFit(
            "tof",
            280,
            10,
            270,
            252,
            1.5,
            1.1,
            RimFit(visible=60, outside=5, inside=3, occluded=2),
            VertexCounts(400, 200, 50, 40, 30, 20, 10),
            Remainder(0.25, 0.125),
        ),
    ),
    shape=ShapeQuality(stretch=0.02, folded_share=0.01, deviation_m=1.5e-3),
    sources={"tof": Source(42, 10**9, 25_000)},
    missing=("color",),
)
IDENTITY = Identity("sheet", "nurbs", "m", "c", 1)
MESH = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32), np.full((3, 3), np.nan, np.float32), np.zeros((3, 2)))


def test_the_covariance_travels_as_its_upper_triangle_row_by_row():
    state = estimate_messages.state(Header(), ESTIMATE, IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 0, {}))
    assert list(state.covariance) == pytest.approx([1.0, 0.1, 0.2, 2.0, 0.3, 3.0])
    assert state.covariance_valid
    assert state.log_likelihood == -12.5


@pytest.mark.parametrize("dimension", [0, 1, 7, 8, 20, 100])
def test_a_covariance_of_any_size_arrives_in_single_precision(dimension):
    covariance = np.random.default_rng(dimension).random((dimension, dimension))
    estimate = replace(ESTIMATE, theta=np.zeros(dimension), covariance=covariance)
    sent = estimate_messages.state(Header(), estimate, IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 0, {}))
    state = DeformationState.FromString(sent.SerializeToString())
    expected = covariance[np.triu_indices(dimension)].astype(np.float32)
    assert list(sent.covariance) == list(state.covariance) == expected.tolist()


@pytest.mark.parametrize("status", [Status.LOST, Status.INITIALIZING])
def test_the_covariance_is_invalid_while_not_tracking(status):
    lost = replace(ESTIMATE, status=status)
    assert not estimate_messages.state(Header(), lost, IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 0, {})).covariance_valid
    assert estimate_messages.mesh(Header(), lost, IDENTITY).covariance_f32 == b""


def test_the_covariance_of_every_vertex_travels_as_its_six_different_entries():
    sent = estimate_messages.mesh(Header(), ESTIMATE, IDENTITY)
    entries = np.frombuffer(sent.covariance_f32, "<f4").reshape(-1, 6)
    matrices = entries[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    np.testing.assert_array_equal(matrices, ESTIMATE.vertex_covariance)


def test_the_classes_of_the_rim_are_those_of_the_first_sensor_that_tells_them():
    assert estimate_messages.mesh(Header(), ESTIMATE, IDENTITY).rim_classes_u8 == b""
    fits = tuple(replace(fit, rim=RimFit(classes=one)) for fit, one in zip(ESTIMATE.fits, (b"", bytes([1, 0, 5]))))
    reported = replace(ESTIMATE, fits=(*fits, replace(ESTIMATE.fits[0], rim=RimFit(classes=bytes(3)))))
    expected = fits[1].rim.classes if len(fits) > 1 else bytes(3)
    assert estimate_messages.mesh(Header(), reported, IDENTITY).rim_classes_u8 == expected


def test_every_sensor_is_named_with_what_it_contributed_and_what_was_lost():
    state = estimate_messages.state(
        Header(), ESTIMATE, IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 3, {"tof": 4, "color": 5})
    )
    tof, color = state.sensors
    assert (tof.sensor, tof.seq, tof.samples, tof.dropped, tof.missing) == ("tof", 42, 270, 4, False)
    assert (color.sensor, color.dropped, color.missing) == ("color", 5, True)
    assert (state.samples, state.clock_sigma_ns, state.skipped) == (270, 25_000, 3)


def test_what_the_status_is_judged_by_is_published():
    state = estimate_messages.state(Header(), ESTIMATE, IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 0, {}))
    tof = state.sensors[0]
    assert (tof.rim_visible, tof.rim_outside, tof.rim_inside, tof.rim_occluded) == (60, 5, 3, 2)
    shares = (tof.agreeing_share, tof.disagreeing_share, tof.no_return_share)
    assert shares == pytest.approx((0.5, 0.125, 0.1))
    hidden = (tof.occluder_share, tof.self_occluded_share, tof.outside_share)
    assert hidden == pytest.approx((0.075, 0.05, 0.025))
    assert (tof.unexplained_share, tof.unexplained_at_first) == (0.25, 0.125)
    assert (state.stretch, state.folded_share, state.deviation_m) == (0.02, 0.01, 1.5e-3)


def test_effort_and_budget_of_the_search_are_published():
    state = estimate_messages.state(Header(), ESTIMATE, IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 0, {}))
    assert (state.searcher, state.stop) == ("cma_es", estimate_messages.State.STOP_TIME)
    assert (state.generations, state.evaluations) == (3, 45)
    assert (state.budget_evaluations, state.budget_ms) == (1000, 24.0)


@pytest.mark.parametrize("stop", Stop)
def test_every_reason_to_stop_has_its_word(stop):
    state = estimate_messages.state(
        Header(), replace(ESTIMATE, search=SearchReport(stop=stop)), IDENTITY, Effort(1.0, 24.0, 2.0, 0.5, 0, {})
    )
    word = estimate_messages.State.Stop.Name(state.stop).removeprefix("STOP_").lower()
    assert word == ("unspecified" if stop == Stop.NOTHING else stop.value)


def test_theta_of_another_mesh_or_model_has_another_id():
    first = estimate_messages.with_mesh(IDENTITY, MESH, 1, {})
    moved = estimate_messages.with_mesh(IDENTITY, replace(MESH, vertices=MESH.vertices + 1e-6), 2, {})
    rigid = estimate_messages.with_mesh(replace(IDENTITY, model="rigid"), MESH, 1, {})
    assert len({first.model_id, moved.model_id, rigid.model_id}) == 3
    assert moved.mesh_version == 2


def test_what_followed_from_the_first_image_is_published():
    made = estimate_messages.with_mesh(IDENTITY, MESH, 1, {"model.control_points": (5.0, 4.0), "mesh.vertices": (3.0,)})
    state = estimate_messages.state(Header(), ESTIMATE, made, Effort(1.0, 24.0, 2.0, 0.5, 0, {}))
    assert list(state.derived["model.control_points"].values) == [5.0, 4.0]
    assert list(state.derived["mesh.vertices"].values) == [3.0]


def test_colors_travel_only_if_a_sensor_saw_some():
    assert estimate_messages.topology(Header(), MESH, IDENTITY).colors_u8 == b""
    seen = replace(MESH, colors=np.array([[1, 2, 3], [4, 5, 6], [np.nan] * 3], np.float32))
    assert estimate_messages.topology(Header(), seen, IDENTITY).colors_u8 == bytes([1, 2, 3, 4, 5, 6, 0, 0, 0])
