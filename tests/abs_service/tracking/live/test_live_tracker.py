"""A live tracker turns exposures into estimates, and announces its mesh before it uses it."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from abs_client.estimates.expansion import surface_of
from absmsg.v1.deformation_state_pb2 import CompactState, DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health as Message
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from tests.abs_service.tracking.live.live_tracker_bench import SIMULATION, Bench


@pytest.fixture
def bench():
    return Bench()


def test_an_exposure_becomes_an_estimate(bench):
    bench.expose(0)
    bench.now_ns += 7_000_000
    bench.live.process_next()
    (state,) = bench.states
    assert state.status == DeformationState.STATUS_TRACKING
    assert (state.header.t_host_ns, state.header.seq, state.header.rig) == (0, 0, "demo")
    assert state.age_ms == pytest.approx(7)
    assert (state.skipped, state.generations, len(state.theta)) == (0, 2, 48)
    said = bench.said
    assert said.level == Message.LEVEL_OK
    assert (said.labels["phase"], said.counters["estimates"]) == ("tracking", 1)


def test_the_topology_is_announced_before_the_first_state_that_uses_it(bench):
    for k in range(2):
        bench.expose(k)
        bench.live.process_next()
    topics = [sample.topic for sample in bench.bus.sent if sample.topic.startswith("sheet/")]
    estimate = ["sheet/state", "sheet/mesh", "sheet/theta"]
    assert topics == ["sheet/topology", *estimate, *estimate]
    (topology,) = bench.sent("sheet/topology", MeshTopology)
    assert {state.mesh_version for state in bench.states} == {topology.mesh_version}
    meshes = bench.sent("sheet/mesh", DeformedMesh)
    assert all(len(mesh.vertices_f32) == len(topology.rest_vertices_f32) for mesh in meshes)
    assert [mesh.header.t_host_ns for mesh in meshes] == [state.header.t_host_ns for state in bench.states]
    # Whoever comes later asks.
    assert [MeshTopology.FromString(s.payload) for s in bench.bus.query("sheet/topology", 0.0)] == [topology]


def test_vertices_follow_from_theta_and_the_basis_of_the_mesh(bench):
    for k in range(40):
        bench.expose(k)
        bench.live.process_next()
    (topology,) = bench.sent("sheet/topology", MeshTopology)
    compact, meshes = bench.sent("sheet/theta", CompactState), bench.sent("sheet/mesh", DeformedMesh)
    surface = surface_of(topology.basis)
    assert 2 <= [bool(one.offset_f32) for one in compact].count(True) < 10  # in each second, and while they are learnt
    off = []
    for one, mesh in zip(compact, meshes, strict=True):
        if one.offset_f32:
            surface = replace(surface, offset=np.frombuffer(one.offset_f32, "<f4"))
        expected = np.frombuffer(mesh.vertices_f32, "<f4").reshape(-1, 3)
        found = surface.vertices(np.frombuffer(one.theta_f32, "<f4"))
        off.append(np.sqrt(np.mean(np.sum((found - expected) ** 2, axis=1))))
        assert (one.header, one.mesh_version) == (mesh.header, mesh.mesh_version)
    assert max(off) < 1e-3  # offsets are those learnt from the frame itself, vertices were computed before
    assert max(off[10:]) < 0.2e-3


def test_topologies_are_numbered_by_themselves_so_that_a_recorder_misses_none(bench):
    for k in range(3):
        bench.expose(k)
        bench.live.process_next()
    bench.tracking.reinitialize()
    bench.expose(3)
    bench.live.process_next()
    assert [topology.header.seq for topology in bench.sent("sheet/topology", MeshTopology)] == [1, 2]


def test_without_an_object_it_reports_initializing_and_sends_no_topology(bench):
    bench.expose(0, lambda frame: dataclasses.replace(frame, data=np.zeros_like(frame.data)))
    bench.live.process_next()
    assert bench.states[0].status == DeformationState.STATUS_INITIALIZING
    assert "no connected surface" in bench.states[0].reasons[0]
    assert bench.states[0].mesh_version == 0
    assert bench.sent("sheet/topology", MeshTopology) == []
    assert bench.said.labels["phase"] == "initializing"


def test_the_budget_bounds_the_search_of_all_but_the_first_frame():
    bench = Bench(budget_ms=5)
    bench.tick_ns = 10_000_000  # every look at the clock takes 10 ms
    for k in range(2):
        bench.expose(k)
        bench.live.process_next()
    assert [state.generations for state in bench.states] == [2, 1]
    assert bench.states[1].solve_ms >= 10
    assert [state.budget_ms for state in bench.states] == [5, 5]


def test_viewers_get_scenes_at_their_own_rate():
    bench = Bench(view_hz=1e9 / (2 * (SIMULATION.time_ns(1) - SIMULATION.time_ns(0))))
    for k in range(4):
        bench.expose(k)
        bench.live.process_next()
    scenes, meshes = bench.sent("sheet/scene", SceneUpdate), bench.sent("sheet/mesh", DeformedMesh)
    assert len(scenes) == 2
    points = scenes[1].entities[0].triangles[0].points
    np.testing.assert_array_equal(
        [(one.x, one.y, one.z) for one in points], np.frombuffer(meshes[2].vertices_f32, "<f4").reshape(-1, 3)
    )
