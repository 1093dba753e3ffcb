"""A live tracker takes frame sets as fast as it is, and counts those that it passed over, lost or refused."""

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus import keys
from abs_service.bus.contract import IMAGES
from drivers.contract.frame import Kind
from drivers.encoding import codec
from tests.abs_service.tracking.live.live_tracker_bench import MEMBERS, SIMULATION, Bench


@pytest.fixture
def bench():
    return Bench()


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


def test_without_frames_nothing_is_published(bench):
    bench.live.process_next()
    assert bench.bus.sent == []


def test_malformed_messages_are_counted_and_explained(bench):
    bench.bus.publisher("tof/depth/image", codec.IMAGE_SCHEMA, IMAGES).put(b"\xff", b"\xff")
    bench.live.process_next()
    bench.expose(0)
    bench.live.process_next()
    said = bench.said
    assert said.counters["malformed.tof/depth/image"] == 1
    assert "are no foxglove.RawImage" in said.labels["malformed"]
    assert len(bench.states) == 1
