import math

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health
from absmsg.v1.surface_truth_pb2 import SurfaceTruth

from abs_service.bus.contract import Sample
from abs_service.supervision.health.rig_state import RigState
from abs_service.tracking.log.tracker_log import RunningStats


def sample(topic, message):
    return Sample(topic, message.DESCRIPTOR.full_name, message.SerializeToString())


def grid(z=1.0):
    """A flat sheet of 0.3 × 0.2 m as 5 × 7 material points."""
    x, y = np.meshgrid(np.linspace(-0.15, 0.15, 7), np.linspace(-0.1, 0.1, 5))
    return np.stack([x, y, np.full_like(x, z)], axis=-1).astype("<f4")


def truth(t, z=1.0):
    message = SurfaceTruth(rows=5, columns=7, points_f32=grid(z).tobytes())
    message.header.t_host_ns = t
    return sample("sim/truth", message)


def topology(t):
    message = MeshTopology(tracker="sheet", rest_vertices_f32=grid().tobytes())
    message.header.t_host_ns = t
    return sample("sheet/topology", message)


def state(t, seq, **fields):
    message = DeformationState(tracker="sheet", status=DeformationState.STATUS_TRACKING, theta=[0.5, -0.25], **fields)
    message.header.seq, message.header.t_host_ns = seq, t
    message.header.stamp.FromNanoseconds(1_700_000_000_250_000_000)
    return sample("sheet/state", message)


def mesh(t, z=1.0):
    message = DeformedMesh(tracker="sheet", vertices_f32=grid(z).tobytes())
    message.header.t_host_ns = t
    return sample("sheet/mesh", message)


@pytest.fixture
def live():
    return RigState(["sheet"], lambda: 42)


def take(live, *samples):
    return [report for one in samples for report in live.take(one)]


def test_an_estimate_is_reported_with_its_error_once_its_mesh_has_come(live):
    take(live, truth(1), topology(1), truth(2, z=1.1))
    assert take(live, state(2, 7, solve_ms=9.0, generations=3, evaluations=60)) == []
    (report,) = take(live, mesh(2, z=1.102))
    assert (report.tracker, report.seq, report.status) == ("sheet", 7, "TRACKING")
    assert report.stamp == "2023-11-14T22:13:20.250Z"
    assert report.theta == (0.5, -0.25)
    assert report.error_mm == pytest.approx(2.0, abs=0.01)
    assert report.surface_mm == pytest.approx(2.0, abs=0.01)


def test_a_topology_that_did_not_arrive_is_missed_until_it_comes(live):
    assert live.missing_topologies() == []
    take(live, truth(1), truth(2), state(2, 1), mesh(2))
    assert live.missing_topologies() == ["sheet"]
    take(live, topology(1), topology(1))
    assert live.missing_topologies() == []
    (report,) = take(live, truth(3), state(3, 2), mesh(3))
    assert report.error_mm == pytest.approx(0, abs=1e-3)
    take(live, state(4, 3, mesh_version=2))
    assert live.missing_topologies() == ["sheet"]


def test_an_estimate_whose_mesh_was_lost_is_reported_with_the_next_one_and_without_error(live):
    take(live, truth(1), topology(1), truth(2), truth(3))
    (first,) = take(live, state(2, 1), state(3, 2))
    (second,) = take(live, mesh(3))
    assert (first.seq, first.error_mm) == (1, None)
    assert second.error_mm == pytest.approx(0.0, abs=1e-3)


def test_the_mesh_may_overtake_its_estimate(live):
    take(live, truth(1), topology(1), truth(2))
    (report,) = take(live, mesh(2), state(2, 1))
    assert report.error_mm == pytest.approx(0.0, abs=1e-3)


def test_without_truth_the_error_is_not_known(live):
    (report,) = take(live, topology(1), state(2, 1), mesh(2))
    assert report.error_mm is None
    assert math.isnan(live.trackers["sheet"].error_mm.mean)


def test_the_error_that_the_tracker_expects_needs_no_truth(live):
    message = DeformedMesh(tracker="sheet", vertices_f32=grid(1.0).tobytes())
    message.header.t_host_ns = 2
    message.covariance_f32 = (
        np.tile([4e-6, 1e-6, 1e-6, 4e-6, 1e-6, 1e-6], (grid(1.0).size // 3, 1)).astype("<f4").tobytes()
    )
    (report,) = take(live, state(2, 1), sample("sheet/mesh", message))
    assert report.vertex_sigma_mm == pytest.approx(3.0)
    (report,) = take(live, state(3, 2), mesh(3))
    assert report.vertex_sigma_mm is None


def test_the_shares_of_every_sensor_that_contributed_are_reported(live):
    message = DeformationState(tracker="sheet")
    message.header.t_host_ns = 2
    message.sensors.add(sensor="tof", agreeing_share=0.75, no_return_share=0.25, unexplained_share=math.nan)
    message.sensors.add(sensor="color", missing=True)
    (report,) = take(live, sample("sheet/state", message), mesh(2))
    assert list(report.shares) == ["tof"]
    shares = report.as_dict()["shares"]["tof"]
    assert (shares["agreeing"], shares["no_return"], shares["outside"], shares["unexplained"]) == (
        0.75,
        0.25,
        0.0,
        None,
    )


def test_totals_are_kept_over_all_estimates(live):
    take(live, truth(1), topology(1))
    for t in (2, 3, 4):
        take(live, truth(t), state(t, t, skipped=2), mesh(t, z=1 + t * 1e-3))
    log = live.trackers["sheet"]
    assert (log.estimates, log.skipped, log.error_mm.count) == (3, 6, 3)
    assert log.error_mm.mean == pytest.approx(3.0, abs=0.01)
    assert log.error_mm.max == pytest.approx(4.0, abs=0.01)


def test_health_is_kept_with_the_time_at_which_it_came(live):
    take(live, sample("health/track/sheet", Health(component="track/sheet", labels={"phase": "preparing"})))
    assert live.received["track/sheet"].t_ns == 42
    assert live.preparing()
    take(live, sample("health/track/sheet", Health(component="track/sheet", labels={"phase": "tracking"})))
    assert not live.preparing()
    assert live.health("record").counters == {}


def test_what_cannot_be_read_is_counted_and_harms_nothing(live):
    odd = DeformedMesh(tracker="sheet", vertices_f32=b"12345")
    odd.header.t_host_ns = 2
    take(live, state(2, 1), sample("sheet/mesh", odd))
    take(live, Sample("health/record", Health.DESCRIPTOR.full_name, b"\xff\xff"))
    take(live, sample("sim/truth", SurfaceTruth(rows=5, columns=7)))
    assert live.malformed == 3


def test_messages_of_unknown_components_are_ignored(live):
    assert take(live, Sample("other/state", DeformationState.DESCRIPTOR.full_name, b"")) == []
    assert live.malformed == 0


def test_total():
    total = RunningStats()
    for value in (1.0, None, 3.0):
        total.add(value)
    assert (total.count, total.mean, total.max) == (2, 2.0, 3.0)
