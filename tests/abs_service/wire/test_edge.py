"""Messages of a rig's processes are accepted; everything else is counted by its cause."""

import math
from typing import Any

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import CompactState, DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology, VertexBasis
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import Config, SensorModel
from absmsg.v1.surface_truth_pb2 import SurfaceTruth
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from hypothesis import given

from abs_service.bus.contract import Sample
from abs_service.bus.health import Health as HealthPublisher
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture import sensor_metadata
from abs_service.wire.checked_bus import CheckedBus
from abs_service.wire.edge import MAX_PER_S, MAX_TOPICS, QUIET_S, Edge
from abs_service.wire.viewer_messages import point_cloud, scene_update
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.wire.golden.freeze import BINARY, published
from tests.abs_service.wire.hostile import INFO, MODEL, VALID, samples

S = 1_000_000_000

SHEET = DeformedMesh(tracker="sheet", vertices_f32=np.ones((3000, 3), "<f4").tobytes())
BASIS = VertexBasis(support=2, control_points_u16=bytes(4), value_f32=bytes(8), offset_f32=bytes(4))
FLAT = MeshTopology(tracker="sheet", faces_u32=np.array([[0, 1, 2]], "<u4").tobytes())


def sample(topic, message, attachment=None):
    info = b"" if attachment is None else attachment.SerializeToString()
    return Sample(topic, message.DESCRIPTOR.full_name, message.SerializeToString(), info)


def changed(message: Any, **fields: Any) -> Any:
    copy = type(message)()
    copy.CopyFrom(message)
    copy.MergeFrom(type(message)(**fields))
    return copy


def image(attachment=None, width=2):
    picture = RawImage(frame_id="tof", width=width, height=1, encoding="mono8", step=2, data=b"12")
    return sample("tof/depth/image", picture, attachment)


@pytest.mark.parametrize(
    "good",
    [
        *(sample(topic, message) for topic, message in VALID.items()),
        image(INFO),
        sample("health/capture", Health(component="capture", message="two\nlines", gauges={"a_ms": 1.0})),
        sample("sheet/state", DeformationState(tracker="sheet", age_ms=math.nan, log_likelihood=-math.inf)),
        sample("config", Config(toml="x" * 100_000)),
        sample("clock/there", Header(host_clock="there", t_host_ns=-5)),
        sample("sheet/scene", scene_update(SHEET, FLAT, DeformationState.STATUS_LOST)),
        sample("tof/depth/points", point_cloud("tof", 5, np.ones((3000, 3), np.float32))),
        Sample("schema", sensor_metadata.SCHEMA_MESSAGE, sensor_metadata.schema()),
    ],
    ids=lambda good: good.topic,
)
def test_what_a_rig_sends_comes_in(good):
    edge = Edge(lambda: 0)
    assert edge.admits(good), edge.last_error
    assert edge.refused == {}


@pytest.mark.parametrize("name", sorted(path.stem for path in BINARY.glob("*.bin")))
def test_no_text_or_number_of_the_golden_messages_is_refused(name):
    message = published()[name].FromString((BINARY / f"{name}.bin").read_bytes())
    edge = Edge(lambda: 0)
    edge.admits(sample("tof/depth", message))
    assert set(edge.refused) <= {"content", "type"}  # their parts need not fit together; FrameInfo is an attachment


@pytest.mark.parametrize(
    ("bad", "cause", "reason"),
    [
        (Sample("a/b/c/d", "absmsg.v1.Config", b""), "topic", "one to 3 names"),
        (Sample("\x1b[2J", "absmsg.v1.Config", b""), "topic", "names"),
        (Sample("config", "", b""), "type", "'' is none of"),
        (Sample("config", "absmsg.v1.Config", b"\xff"), "malformed", "1 bytes are no absmsg.v1.Config"),
        (Sample("config", "absmsg.v1.Config", bytes((1 << 24) + 1)), "size", "16777216 are allowed"),
        (sample("config", Config(toml="x" * (1 << 21))), "text", "too long"),
        (sample("health/run", Health(component="run", message="\x1b[2J")), "text", r"'\x1b[2J'"),
        (sample("health/run", Health(component="run", labels={"\x9b2J": ""})), "text", "cannot be printed"),
        (sample("health/run", Health(component="run", gauges={"x": math.inf})), "number", "must be finite"),
        (
            sample("health/run", Health(component="run", counters=dict.fromkeys(map(str, range(2001)), 1))),
            "size",
            "2001",
        ),
        (sample("health/run", Health(component="record")), "content", "belongs to health/record"),
        (sample("health/run", changed(Health(component="run"), level=9)), "range", "level = 9 must be one of"),
        (sample("sheet/state", DeformationState(tracker="sheet", theta=[math.nan])), "number", "theta"),
        (sample("sheet/state", DeformationState(header=Header(seq=2**64 - 1))), "range", "Header.seq"),
        (sample("sheet/mesh", DeformedMesh(tracker="sheet", vertices_f32=b"123")), "content", "are no points"),
        (
            sample("sheet/mesh", DeformedMesh(vertices_f32=np.array([0, 0, np.nan], "<f4").tobytes())),
            "number",
            "finite",
        ),
        (sample("sheet/topology", MeshTopology(faces_u32=bytes(12))), "content", "a face of 0 vertices"),
        (
            sample("sheet/topology", MeshTopology(rest_vertices_f32=bytes(12), basis=BASIS)),
            "content",
            "basis: its sizes",
        ),
        (sample("sheet/theta", CompactState(tracker="sheet", theta_f32=b"123")), "content", "no numbers"),
        (sample("sheet/theta", CompactState(theta_f32=np.array([np.inf], "<f4").tobytes())), "number", "finite"),
        (sample("sim/truth", SurfaceTruth(rows=2**31, columns=2**31)), "content", "are allowed"),
        (
            sample("sim/truth", SurfaceTruth(rows=1, columns=1, points_f32=np.full(3, np.nan, "<f4").tobytes())),
            "number",
            "finite",
        ),
        (sample("tof/model", changed(MODEL, width=2**31)), "range", "SensorModel.width"),
        (sample("tof/model", SensorModel(sensor="tof")), "content", "is no camera"),
        (sample("tof/model", changed(MODEL, header=Header(stamp={"seconds": 10**12}))), "range", "Timestamp.seconds"),
        (sample("color/model", MODEL), "content", "belongs to tof/model"),
        (sample("config", RawImage()), "content", "SENSOR/STREAM/image"),
        (image(changed(INFO, sensor="color")), "content", "one of color/depth"),
        (image(changed(INFO, scale=math.nan)), "number", "scale"),
        (image(width=2**20), "range", "RawImage.width"),
        (Sample("tof/depth/image", "foxglove.RawImage", b"\x08\x01" * 200), "malformed", "more than 100 fields"),
        (Sample("schema", sensor_metadata.SCHEMA_MESSAGE, b"", overwritten=True), "overwritten", "stood still"),
    ],
)
def test_what_no_rig_sends_is_counted_by_its_cause(bad, cause, reason):
    edge = Edge(lambda: 0)
    assert not edge.admits(bad)
    assert edge.refused == {cause: 1}
    assert reason in edge.last_error
    assert edge.last_error.isprintable()


def test_too_many_messages_of_a_topic_in_a_second_are_refused():
    now_ns = [0]
    edge = Edge(lambda: now_ns[0])
    health = sample("health/run", Health(component="run"))
    assert sum(edge.admits(health) for _ in range(MAX_PER_S + 10)) == MAX_PER_S
    assert edge.refused == {"rate": 10}
    assert edge.admits(sample("health/record", Health(component="record")))
    now_ns[0] = S
    assert edge.admits(health)


def test_too_many_topics_are_refused_and_the_known_ones_go_on():
    edge = Edge(lambda: 0)
    flood = [sample(f"health/{number}", Health(component=str(number))) for number in range(MAX_TOPICS + 5)]
    assert sum(map(edge.admits, flood)) == MAX_TOPICS
    assert edge.refused == {"topics": 5}
    assert edge.admits(flood[0])


def test_topics_of_a_flood_make_room_when_it_is_long_over():
    now_ns = [0]
    edge = Edge(lambda: now_ns[0])
    known, *flood = [sample(f"health/{number}", Health(component=str(number))) for number in range(MAX_TOPICS + 2)]
    for one in (known, *flood[:-2], known):
        assert edge.admits(one)
    now_ns[0] = (QUIET_S - 1) * S
    assert edge.admits(known)
    assert not edge.admits(flood[-1])
    now_ns[0] += S
    assert edge.admits(flood[-1])
    assert edge.admits(known)


@given(samples())
def test_no_message_raises(hostile):
    edge = Edge(lambda: 0)
    assert edge.admits(hostile) == (edge.refused == {})


class TestABusThatIsChecked:
    def test_passes_on_what_is_valid_and_tells_the_rest_in_health(self):
        bus, arrived = LoopbackBus(), []
        checked = CheckedBus(bus, lambda: 0)
        checked.subscribe("**", arrived.append)
        health_bus = LoopbackBus()
        health = HealthPublisher(health_bus, "run", HeaderFactory("demo", WallClock()))
        bad, good = sample("tof/model", SensorModel()), sample("tof/model", MODEL)
        bus.deliver(bad)
        bus.deliver(good)
        assert arrived == [good]
        checked.report(health)
        said = health_now(health, health_bus)
        assert said.counters["refused.content"] == 1
        assert said.level == Health.LEVEL_WARNING
        assert said.message.startswith("refused 1 messages, the last: tof/model: ")
        checked.report(health)  # nothing new
        assert health_now(health, health_bus).level == Health.LEVEL_OK

    def test_tells_what_is_wrong_with_the_certificate_of_the_process(self):
        bus = LoopbackBus()
        health = HealthPublisher(bus, "capture", HeaderFactory("demo", WallClock()))
        CheckedBus(bus, lambda: 0, lambda: "it ends tomorrow").report(health)
        said = health_now(health, bus)
        assert (said.level, said.message) == (Health.LEVEL_WARNING, "it ends tomorrow")

    def test_answers_are_checked_too(self):
        bus = LoopbackBus()
        bus.answer_queries("tof/model", "absmsg.v1.SensorModel", lambda: SensorModel().SerializeToString())
        assert CheckedBus(bus, lambda: 0).query("tof/model", 1.0) == []
