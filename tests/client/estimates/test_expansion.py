"""Vertices that a program computes from theta are those of the tracker's model."""

from typing import Any

import numpy as np
import pytest
from abs_client.connection.received import Received
from abs_client.errors import MalformedError
from abs_client.estimates import feeds, reading
from abs_client.estimates.assembly import Assembly
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import CompactState, DeformationState

from abs_service.tracker.models.nurbs import Settings as NurbsSettings
from abs_service.tracker.models.rigid import Settings as Rigid
from abs_service.wire import estimate_messages
from abs_service.wire.estimate_messages import Identity
from tests.abs_service.tracker.models.test_nurbs import MESH

WEIGHTS = tuple((1.0, 2.0 + k, 1.0, 3.0) for k in range(5))
MODELS = {
    "plain": NurbsSettings(control_points=(5, 4)),
    "quadratic": NurbsSettings(control_points=(6, 5), degree=2),
    "weighted": NurbsSettings(control_points=(5, 4), weights=WEIGHTS),
}


class Bench:
    """A tracker's model and what a program makes of its messages."""

    def __init__(self, settings: Any = MODELS["plain"]) -> None:
        self.model = settings.of_mesh(MESH)
        self.assembly = Assembly(lambda: 0)
        self.handlers = feeds.compact(self.assembly)
        self.theta = self.model.rest + np.random.default_rng(3).normal(0, 0.02, self.model.rest.size)
        self.seq = 0

    def topology(self, version=1):
        message = estimate_messages.topology(
            Header(boot_id="a"), self.model.mesh, Identity("sheet", "nurbs", "", "", version), self.model
        )
        return Received("topology", message.SerializeToString())

    def compact(self, version: int = 1, offset: Any = (), theta: Any = None) -> Received:
        state = DeformationState(
            header=Header(boot_id="a", seq=self.seq),
            tracker="sheet",
            status=DeformationState.STATUS_DEGRADED,
            mesh_version=version,
            theta=self.theta if theta is None else theta,
            deviation_m=0.002,
            reasons=["folded"],
        )
        self.seq += 1
        return Received("theta", estimate_messages.compact(state, np.array(offset, np.float64)).SerializeToString())

    def vertices(self):
        whole = self.assembly.take()
        assert whole is not None
        return np.frombuffer(whole.mesh.vertices_f32, "<f4").reshape(-1, 3)

    @property
    def expected(self):
        return self.model.deform(self.theta[None]).vertices[0].T


@pytest.mark.parametrize("settings", MODELS.values(), ids=MODELS)
def test_vertices_are_those_of_the_model(settings):
    bench = Bench(settings)
    bench.handlers["topology"](bench.topology())
    bench.handlers["theta"](bench.compact())
    assert np.abs(bench.expected - bench.model.mesh.vertices).max() > 0.01
    np.testing.assert_allclose(bench.vertices(), bench.expected, atol=2e-6)


def test_what_else_is_known_of_the_estimate_is_there():
    bench = Bench()
    bench.handlers["topology"](bench.topology())
    bench.handlers["theta"](bench.compact())
    whole = bench.assembly.take()
    assert whole is not None
    assert whole.state.status == DeformationState.STATUS_DEGRADED
    assert list(whole.state.reasons) == ["folded"]
    assert whole.state.theta == pytest.approx(bench.theta, abs=1e-7)
    assert (whole.state.deviation_m, whole.state.covariance_valid) == (pytest.approx(0.002), False)
    assert len(whole.topology.faces_u32) == bench.model.mesh.faces.size * 4


def test_theta_waits_for_the_basis_of_its_mesh():
    bench = Bench()
    bench.handlers["topology"](bench.topology(version=1))
    bench.handlers["theta"](bench.compact(version=2))
    assert bench.assembly.take() is None
    assert bench.assembly.lacks_topology
    bench.handlers["topology"](bench.topology(version=2))
    np.testing.assert_allclose(bench.vertices(), bench.expected, atol=2e-6)
    assert not bench.assembly.lacks_topology


def test_learnt_offsets_replace_those_of_the_basis():
    bench = Bench()
    bench.handlers["topology"](bench.topology())
    learnt = bench.model.offset + 0.003
    bench.handlers["theta"](bench.compact(offset=learnt))
    bench.model.set_offsets(learnt, np.zeros(len(learnt)))
    np.testing.assert_allclose(bench.vertices(), bench.expected, atol=2e-6)
    bench.handlers["theta"](bench.compact())
    np.testing.assert_allclose(bench.vertices(), bench.expected, atol=2e-6)


def test_a_model_without_a_basis_has_theta_alone():
    bench = Bench(Rigid())
    bench.handlers["topology"](bench.topology())
    bench.handlers["theta"](bench.compact())
    whole = bench.assembly.take()
    assert whole is not None
    assert list(whole.state.theta) == pytest.approx(bench.theta, abs=1e-6)
    assert whole.mesh.vertices_f32 == b""


def test_a_basis_that_is_too_large_for_a_message_is_not_sent(monkeypatch):
    monkeypatch.setattr(estimate_messages, "MAX_BASIS", 100)
    assert not reading.topology(Bench().topology()).HasField("basis")


def test_without_an_object_there_is_a_state_without_vertices():
    bench = Bench()
    bench.handlers["theta"](bench.compact(version=0, theta=[]))
    assert bench.vertices().shape == (0, 3)


def test_an_estimate_has_some_hundred_bytes():
    bench = Bench()
    assert len(bench.compact().payload) < 4 * bench.theta.size + 100


@pytest.mark.parametrize("change", [{"offset": [0.0] * 5}, {"theta": [0.1] * 6}])
def test_what_does_not_fit_the_mesh_is_malformed(change):
    bench = Bench()
    bench.handlers["topology"](bench.topology())
    with pytest.raises(MalformedError, match="do not fit the mesh"):
        bench.handlers["theta"](bench.compact(**change))


def test_messages_of_odd_sizes_are_malformed():
    for odd in (CompactState(theta_f32=b"123"), CompactState(offset_f32=b"12345")):
        with pytest.raises(MalformedError):
            reading.compact(Received("theta", odd.SerializeToString()))
    bench = Bench()
    message = reading.topology(bench.topology())
    message.basis.along_u_f32 = message.basis.along_u_f32[:-4]
    with pytest.raises(MalformedError, match="basis"):
        reading.topology(Received("topology", message.SerializeToString()))
