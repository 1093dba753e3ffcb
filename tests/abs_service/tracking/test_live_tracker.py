"""A live tracker takes frame sets, counts what it passed over, and announces its mesh before it uses it."""

import dataclasses
from collections import Counter

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health as Message
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from abs_service.bus import keys
from abs_service.bus.clock_offsets import ClockOffsets, answer
from abs_service.bus.contract import IMAGES
from abs_service.bus.frames import FrameSubscriber
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.pairing.frame_set_queue import FrameSetQueue
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.detection.regions import box
from abs_service.tracker.optimizers import cma
from abs_service.tracking.estimate_publisher import EstimatePublisher
from abs_service.tracking.live_tracker import LiveTracker
from abs_service.tracking.session import TrackingSession, streams
from abs_service.tracking.tracker_health import TrackerHealth
from drivers.contract.frame import Kind
from drivers.encoding import codec
from tests.abs_service.bus.loopback import LoopbackBus
from tests.abs_service.tracking.driving import default_plan, rig_of, simulate

SIMULATION = simulate("simulated://sheet?seed=1")
RIG = rig_of(SIMULATION)
MEMBERS = streams(RIG.sensors.values())


class Bench:
    """A live tracker on a loopback bus with a clock that only the test moves."""

    def __init__(self, budget_ms=1e6, tolerance_ns=12_000_000, view_hz=0.0, **parts):
        self.now_ns = self.tick_ns = 0
        self.bus = LoopbackBus()
        self.wall = WallClock(monotonic=lambda: self.now_ns, wall=lambda: self.now_ns + 10**18)
        self.headers = self.capture = HeaderFactory("demo", self.wall, host="here")
        self.health = Health(self.bus, "track/sheet", self.headers)
        frames = FrameSubscriber(self.bus, MEMBERS, lambda: self.now_ns)
        self.sets = FrameSetQueue(frames, Synchroniser(MEMBERS[0], MEMBERS, tolerance_ns), lambda: self.now_ns)
        self.tracking = TrackingSession(RIG, default_plan(optimizer=cma.Settings(generations=2), **parts))
        self.clocks = ClockOffsets(self.bus, lambda: self.now_ns, "here")
        self.tracker_health = TrackerHealth(self.health, self.sets, self.clock)
        self.live = LiveTracker(
            self.tracking,
            self.sets,
            EstimatePublisher(self.bus, self.headers, "sheet", "nurbs", RIG.calib_id, view_hz),
            self.tracker_health,
            self.clock,
            self.clocks,
            budget_ms,
        )
        self.published = Counter()
        self.lost = set()  # exposures that the bus loses

    def clock(self):
        """Time passes whenever the tracker looks at it."""
        self.now_ns += self.tick_ns
        return self.now_ns

    def expose(self, k, change=lambda frame: frame, kinds=tuple(Kind)):
        """Publishes exposure k, which has just been taken."""
        self.now_ns = max(self.now_ns, SIMULATION.time_ns(k))
        for taken in SIMULATION.expose(k)[0]:
            if taken.kind in kinds:
                frame = change(dataclasses.replace(taken, t_arrival_ns=self.now_ns))
                topic = keys.image(*frame.key)
                header = self.capture.at(frame.t_host_ns, self.published[topic])
                self.published[topic] += 1
                if k not in self.lost:
                    publisher = self.bus.publisher(topic, codec.IMAGE_SCHEMA, IMAGES)
                    publisher.put(codec.encode_image(frame, 0), codec.encode_info(frame, header))

    def sent(self, topic, message):
        return [message.FromString(sample.payload) for sample in self.bus.sent if sample.topic == topic]

    @property
    def states(self):
        return self.sent("sheet/state", DeformationState)

    @property
    def said(self):
        """The last health."""
        self.tracker_health.report()
        self.health.publish()
        return self.sent("health/track/sheet", Message)[-1]


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
    assert topics == ["sheet/topology", "sheet/state", "sheet/mesh", "sheet/state", "sheet/mesh"]
    (topology,) = bench.sent("sheet/topology", MeshTopology)
    assert {state.mesh_version for state in bench.states} == {topology.mesh_version}
    meshes = bench.sent("sheet/mesh", DeformedMesh)
    assert all(len(mesh.vertices_f32) == len(topology.rest_vertices_f32) for mesh in meshes)
    assert [mesh.header.t_host_ns for mesh in meshes] == [state.header.t_host_ns for state in bench.states]
    # Whoever comes later asks.
    assert [MeshTopology.FromString(s.payload) for s in bench.bus.query("sheet/topology", 0.0)] == [topology]


def test_before_a_tracker_is_known_to_be_fast_the_newest_set_wins_and_the_others_are_counted(bench):
    for k in range(3):
        bench.expose(k)
    bench.live.process_next()
    bench.expose(3)
    bench.live.process_next()
    assert [state.header.t_host_ns for state in bench.states] == [SIMULATION.time_ns(2), SIMULATION.time_ns(3)]
    assert [state.skipped for state in bench.states] == [2, 0]
    assert bench.said.counters["skipped"] == 2


def test_a_tracker_that_is_faster_than_the_cameras_works_off_what_a_stall_left(bench):
    for k in range(4):  # three quick turns and a slow one
        bench.expose(k)
        bench.live.process_next()
        bench.now_ns += 20_000_000 if k < 3 else 120_000_000
        if k < 3:
            bench.live.process_next()  # finds nothing
    for k in range(4, 7):
        bench.expose(k)
    for _ in range(3):
        bench.live.process_next()
        bench.now_ns += 20_000_000
    assert [state.header.t_host_ns for state in bench.states] == [SIMULATION.time_ns(k) for k in range(7)]
    assert bench.said.counters["skipped"] == 0


def test_a_slower_tracker_takes_the_newest(bench):
    for k in range(6):
        bench.expose(k)
        if k % 2:
            bench.live.process_next()
            bench.now_ns += 50_000_000
    assert [state.header.t_host_ns for state in bench.states] == [SIMULATION.time_ns(k) for k in (1, 3, 5)]
    assert [state.skipped for state in bench.states] == [1, 1, 1]


def test_topologies_are_numbered_by_themselves_so_that_a_recorder_misses_none(bench):
    for k in range(3):
        bench.expose(k)
        bench.live.process_next()
    bench.tracking.reinitialize()
    bench.expose(3)
    bench.live.process_next()
    assert [topology.header.seq for topology in bench.sent("sheet/topology", MeshTopology)] == [1, 2]


def test_frames_that_newer_ones_pushed_out_are_counted_too(bench):
    for k in range(10):
        bench.expose(k)
    bench.live.process_next()
    assert bench.states[0].header.t_host_ns == SIMULATION.time_ns(9)
    counters = bench.said.counters
    dropped = [number for name, number in counters.items() if name.startswith("dropped.")]
    assert len(dropped) == 3
    assert counters["skipped"] + dropped[0] == 9


def test_frames_that_the_bus_lost_are_counted_by_topic_and_sensor(bench):
    bench.lost = {1, 2, 4}
    for k in range(6):
        bench.expose(k)
        bench.live.process_next()
    counters = bench.said.counters
    topics = [keys.image(*key) for key in MEMBERS]
    assert {topic: counters[f"lost.{topic}"] for topic in topics} == dict.fromkeys(topics, 3)
    assert {sensor.sensor: sensor.dropped for sensor in bench.states[-1].sensors} == {"tof": 6, "color": 3}


SECOND = 1_000_000_000


def test_a_tracker_without_frames_is_an_error_until_they_come(bench):
    bench.expose(0)
    bench.live.process_next()
    bench.now_ns += SECOND
    assert bench.said.level == Message.LEVEL_OK, "the first may take long"
    for _ in range(10):
        bench.now_ns += SECOND
        bench.tracker_health.report()
    said = bench.said
    assert said.level == Message.LEVEL_ERROR
    assert said.message == "no estimate for 11 s: no frames come from the cameras"
    bench.expose(1)
    bench.live.process_next()
    assert bench.said.level == Message.LEVEL_OK


def test_a_tracker_whose_frames_are_all_of_no_use_says_why(bench):
    for k in range(50):
        bench.expose(k, lambda frame: dataclasses.replace(frame, seq=min(frame.seq, 2)))
        bench.live.process_next()
    said = bench.said
    assert said.level == Message.LEVEL_ERROR
    assert said.message.startswith("no estimate for 2 s: since then unused.")
    assert ".duplicate 47" in said.message


def test_without_frames_nothing_is_published(bench):
    bench.live.process_next()
    assert bench.bus.sent == []


def test_a_set_that_waits_for_nothing_any_more_is_taken_at_its_deadline(bench):
    bench.expose(0)
    bench.live.process_next()
    bench.expose(1, kinds=(Kind.DEPTH, Kind.AMPLITUDE))
    bench.live.process_next()
    assert len(bench.states) == 1
    bench.now_ns += 200_000_000
    bench.live.process_next()
    state = bench.states[1]
    assert state.status == DeformationState.STATUS_DEGRADED
    assert list(state.reasons) == ["no frame from color"]
    assert [(sensor.sensor, sensor.missing) for sensor in state.sensors] == [("tof", False), ("color", True)]
    said = bench.said
    assert said.level == Message.LEVEL_WARNING
    assert said.message == "DEGRADED: no frame from color"


def test_without_an_object_it_reports_initializing_and_sends_no_topology(bench):
    bench.expose(0, lambda frame: dataclasses.replace(frame, data=np.zeros_like(frame.data)))
    bench.live.process_next()
    assert bench.states[0].status == DeformationState.STATUS_INITIALIZING
    assert "no connected surface" in bench.states[0].reasons[0]
    assert bench.states[0].mesh_version == 0
    assert bench.sent("sheet/topology", MeshTopology) == []
    assert bench.said.labels["phase"] == "initializing"


def test_frames_that_do_not_fit_the_rig_are_an_error_that_passes(bench):
    bench.expose(0, lambda frame: dataclasses.replace(frame, data=frame.data[:100]))
    bench.live.process_next()
    said = bench.said
    assert said.level == Message.LEVEL_ERROR
    assert "pixels, but the camera model of sensors." in said.message
    assert said.counters["rejected"] == 1
    assert bench.states == []
    # In a new epoch the sensor may have another size.
    bench.expose(1, lambda frame: dataclasses.replace(frame, epoch=1))
    bench.live.process_next()
    assert len(bench.states) == 1
    assert bench.said.level == Message.LEVEL_OK


def test_what_the_residuals_say_of_the_noise_models_is_in_health(bench):
    for k in (0, 31):
        bench.expose(k)
        bench.live.process_next()
    assert bench.said.gauges["residual_variance.tof"] == pytest.approx(1, abs=0.5)


def test_malformed_messages_are_counted_and_explained(bench):
    bench.bus.publisher("tof/depth/image", codec.IMAGE_SCHEMA, IMAGES).put(b"\xff", b"\xff")
    bench.live.process_next()
    bench.expose(0)
    bench.live.process_next()
    said = bench.said
    assert said.counters["malformed.tof/depth/image"] == 1
    assert "are no foxglove.RawImage" in said.labels["malformed"]
    assert len(bench.states) == 1


def test_the_budget_bounds_the_search_of_all_but_the_first_frame():
    bench = Bench(budget_ms=5)
    bench.tick_ns = 10_000_000  # every look at the clock takes 10 ms
    for k in range(2):
        bench.expose(k)
        bench.live.process_next()
    assert [state.generations for state in bench.states] == [2, 1]
    assert bench.states[1].solve_ms >= 10
    assert [state.budget_ms for state in bench.states] == [5, 5]


def test_doubts_about_the_object_are_in_every_state_and_in_health():
    bench = Bench(region=box.Settings((-9.0, -9.0, 0.0), (9.0, 9.0, 9.0)))
    for k in range(2):
        bench.expose(k)
        bench.live.process_next()
    first, second = bench.states
    (doubt,) = first.warnings
    assert "is the region right?" in doubt
    assert list(second.warnings) == [doubt]
    said = bench.said
    assert said.level == Message.LEVEL_WARNING
    assert doubt in said.message


def test_a_wrong_depth_scale_is_a_warning_until_it_is_right(bench):
    bench.expose(0, lambda frame: dataclasses.replace(frame, scale=frame.scale * 1e-3))
    bench.live.process_next()
    (state,) = bench.states
    assert state.status == DeformationState.STATUS_INITIALIZING
    assert "is the depth scale right?" in state.warnings[0]
    said = bench.said
    assert said.level == Message.LEVEL_WARNING
    assert state.warnings[0] in said.message
    bench.expose(1, lambda frame: dataclasses.replace(frame, epoch=1))
    bench.live.process_next()
    assert list(bench.states[1].warnings) == []
    assert bench.said.level == Message.LEVEL_OK


class Elsewhere:
    """The cameras of a bench are on another host.

    Args:
        bench: where the tracker runs.
        behind_ns: how far that host's clock is behind ours.
        boot: which boot of that host.
    """

    def __init__(self, bench, behind_ns, boot="first-boot"):
        self._bench, self._behind_ns = bench, behind_ns
        bench.capture = HeaderFactory("demo", bench.wall, host=boot)

    def expose(self, k, **given):
        self._bench.expose(k, self._shift, **given)

    def _shift(self, frame):
        times = {name: getattr(frame, name) - self._behind_ns for name in ("t_host_ns", "t_arrival_ns")}
        return dataclasses.replace(frame, **times, epoch=max(frame.t_host_ns - self._behind_ns, 0) // 10**8)


def test_estimates_go_on_after_a_reboot_of_the_capture_host(bench):
    cameras = Elsewhere(bench, -(10**15))
    for k in range(3):
        cameras.expose(k)
        bench.live.process_next()
    cameras = Elsewhere(bench, -(10**10), boot="second-boot")
    for k in range(3, 6):
        cameras.expose(k)
        bench.live.process_next()
    assert [state.status for state in bench.states] == 6 * [DeformationState.STATUS_TRACKING]
    assert [state.mesh_version for state in bench.states] == [1, 1, 1, 2, 2, 2]


def test_a_tracker_whose_clock_is_far_ahead_waits_for_all_sensors(bench):
    depth = next(kind for kind in Kind if kind.value == MEMBERS[0][1])
    cameras = Elsewhere(bench, 2000 * 10**9)
    for k in range(3):
        cameras.expose(k, kinds=(depth,))
        bench.live.process_next()
        cameras.expose(k, kinds=set(Kind) - {depth})
        bench.live.process_next()
    assert len(bench.states) == 3
    assert not any(sensor.missing for state in bench.states for sensor in state.sensors)


def test_the_age_across_hosts_is_unknown_until_their_clocks_are_compared(bench):
    cameras, behind_ns = Elsewhere(bench, 2000 * 10**9), 2000 * 10**9
    there = WallClock(monotonic=lambda: bench.now_ns - behind_ns, wall=lambda: 0)
    answer(bench.bus, HeaderFactory("demo", there, host="first-boot"))
    for k in range(2):
        cameras.expose(k)
        bench.now_ns += 7_000_000
        bench.live.process_next()
        bench.clocks.measure()
    before, after = bench.states
    assert np.isnan([before.age_ms, before.age_error_ms]).all()
    assert after.age_ms == pytest.approx(7)
    assert after.age_error_ms == pytest.approx(0, abs=0.1)
    assert (after.header.host_clock, after.header.t_host_ns) == ("first-boot", SIMULATION.time_ns(1) - behind_ns)
    assert after.header.stamp.ToNanoseconds() == 10**18 + SIMULATION.time_ns(1)
    assert bench.said.gauges["clock.offset_s"] == pytest.approx(2000)


def test_on_one_host_the_age_has_no_error(bench):
    bench.expose(0)
    bench.live.process_next()
    assert bench.states[0].age_error_ms == 0


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
