"""Frames across the bus: the same at both ends, never late, every loss counted."""

import queue
import threading
import time
from dataclasses import fields, replace

import numpy as np
import pytest
from absmsg.v1 import frame_info_pb2
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS, IMAGES
from abs_service.bus.frames import DEPTH, FramePublisher, FrameSubscriber
from abs_service.bus.sequence_gaps import LATE_NS
from abs_service.bus.stamps import HeaderFactory, WallClock
from drivers.contract.device import Truth
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding import codec
from tests.abs_service.bus.loopback import LoopbackBus
from tests.waiting import eventually


def frame(seq, sensor="tof", stream="depth", epoch=0):
    return Frame(
        sensor=sensor,
        stream=stream,
        kind=Kind.DEPTH,
        data=np.full((144, 176), seq % 1000, "<u2"),
        encoding="16UC1",
        geometry=Geometry.RADIAL,
        t_host_ns=10**9 + seq,
        t_arrival_ns=10**9 + seq,
        seq=seq,
        epoch=epoch,
        filters=("median",),
    )


#: What only a frame that came over the bus has.
RECEIVED = ("host_clock", "t_received_ns")


def same(a, b):
    """True if two frames hold the same, apart from how one came here."""
    return all(
        np.array_equal(
            getattr(a, f.name), getattr(b, f.name), equal_nan=f.name in ("exposure_s", "gain", "temperature_c")
        )
        for f in fields(Frame)
        if f.name not in RECEIVED
    )


@pytest.fixture
def headers():
    return HeaderFactory("demo", WallClock())


def publisher(bus, headers):
    return FramePublisher(bus, headers, "sim")


def test_frames_and_truths_arrive_as_they_were(headers):
    bus = LoopbackBus()
    subscriber = FrameSubscriber(bus, [("tof", "depth")], time.monotonic_ns)
    truth = Truth(3, 123, np.ones((2, 2, 3), np.float32))
    with publisher(bus, headers) as sink:
        sink.on_frame(frame(5))
        sink.on_truth(truth)
    arrived = subscriber.take(0)
    assert arrived is not None
    assert same(arrived, frame(5))
    image, known = bus.sent
    assert (known.topic, known.message) == ("sim/truth", "absmsg.v1.SurfaceTruth")
    assert np.array_equal(codec.decode_truth(known.payload).points_r, truth.points_r)
    header = frame_info_pb2.FrameInfo.FromString(image.attachment).header
    assert (header.rig, header.boot_id, header.t_host_ns) == ("demo", headers.boot_id, 10**9 + 5)
    assert sink.published == {"tof/depth/image": 1, "sim/truth": 1}


def test_a_frame_crosses_real_sessions_unchanged(open_bus, headers):
    open_bus()
    subscriber = FrameSubscriber(open_bus(), [("tof", "depth")], time.monotonic_ns)
    with publisher(open_bus(), headers) as sink:
        arrived = None
        while arrived is None:
            sink.on_frame(frame(5))
            arrived = subscriber.take(0.05)
    assert same(arrived, frame(5))


def test_a_received_frame_says_when_it_came_and_of_which_clock_its_times_are():
    bus, now = LoopbackBus(), [7]
    subscriber = FrameSubscriber(bus, [("tof", "depth")], lambda: now[0])
    with publisher(bus, HeaderFactory("demo", WallClock(), host="camera")) as sink:
        sink.on_frame(frame(5))
    now[0] = 20  # the reader is late
    arrived = subscriber.take(0)
    assert arrived is not None
    assert (arrived.host_clock, arrived.t_received_ns, arrived.t_arrival_ns) == ("camera", 7, 10**9 + 5)


def test_images_are_numbered_as_they_are_published(headers):
    bus = LoopbackBus()
    with publisher(bus, headers) as sink:
        for number, seq in enumerate((5, 9, 10)):
            sink.on_frame(frame(seq))
            assert eventually(lambda number=number: sink.published.get("tof/depth/image", 0) > number)
    infos = [frame_info_pb2.FrameInfo.FromString(sample.attachment) for sample in bus.sent]
    assert [(info.header.seq, info.seq) for info in infos] == [(0, 5), (1, 9), (2, 10)]


def test_a_publisher_that_falls_behind_drops_the_oldest_and_never_blocks(headers):
    release, entered = threading.Event(), queue.SimpleQueue()
    bus = LoopbackBus()

    def hold(_):
        entered.put(None)
        release.wait()

    bus.subscribe("**", hold)
    with publisher(bus, headers) as sink:
        sink.on_frame(frame(0))
        entered.get(timeout=5)
        for seq in range(1, 11):
            sink.on_frame(frame(seq))
        sink.on_frame(frame(0, stream="other"))
        assert sink.dropped == {"tof/depth/image": 10 - DEPTH}
        release.set()
    sent = [codec.decode(sample.payload, sample.attachment) for sample in bus.sent]
    assert [(item.stream, item.seq) for item in sent] == [("depth", n) for n in (0, 7, 8, 9, 10)] + [("other", 0)]


@pytest.mark.parametrize("wrong", [{"t_host_ns": 2**70}, {"seq": -1}, {"epoch": -1}, {"scale": "1"}])
def test_what_no_message_can_hold_is_told_and_ends_no_camera(headers, wrong):
    bus = LoopbackBus()
    with publisher(bus, headers) as sink:
        for one in (frame(1), replace(frame(2), **wrong), frame(3)):
            sink.on_frame(one)
    assert [codec.decode(sample.payload, sample.attachment).seq for sample in bus.sent] == [1, 3]
    assert sink.dropped == {"tof/depth/image": 1}
    assert sink.take_trouble().startswith("tof/depth/image cannot be published: ")
    assert sink.take_trouble() == ""


def test_a_slow_reader_gets_the_newest_and_the_loss_is_counted(headers):
    bus = LoopbackBus()
    subscriber = FrameSubscriber(bus, [("tof", "depth"), ("color", "depth")], time.monotonic_ns, depth=2)
    with publisher(bus, headers) as sink:
        for seq in range(5):
            sink.on_frame(frame(seq))
            while sink.published.get("tof/depth/image", 0) <= seq:
                threading.Event().wait(0.001)
        sink.on_frame(frame(9, sensor="color"))
    taken = [subscriber.take(0) for _ in range(3)]
    assert [item and (item.sensor, item.seq) for item in taken] == [("tof", 3), ("tof", 4), ("color", 9)]
    assert subscriber.dropped == {"tof/depth/image": 3}


def test_what_is_no_frame_of_its_topic_is_counted_and_explained(headers):
    bus = LoopbackBus()
    subscriber = FrameSubscriber(bus, [("tof", "depth")], time.monotonic_ns)
    topic = keys.image("tof", "depth")
    raw = bus.publisher(topic, codec.IMAGE_SCHEMA, IMAGES)
    raw.put(b"\xff\xff", b"\xff")
    assert subscriber.take(0) is None
    raw.put(codec.encode_image(frame(1, "x"), 0), codec.encode_info(frame(1, "x"), headers.now(0)))
    assert subscriber.take(0) is None
    assert subscriber.malformed == {topic: 2}
    assert subscriber.last_error == "a frame of x/depth arrived on tof/depth/image"


def test_images_that_nothing_follows_are_lost_when_capture_has_said_how_many_there_were(headers):
    bus, now = LoopbackBus(), [0]
    subscriber = FrameSubscriber(bus, [("tof", "depth")], lambda: now[0])
    with publisher(bus, headers) as sink:
        sink.on_frame(frame(5))
    said = Health(header=headers.now(0), component="capture", counters={"published.tof/depth/image": 3})
    bus.publisher("health/capture", Health.DESCRIPTOR.full_name, EVENTS).put(said.SerializeToString())
    assert subscriber.lost == {}
    now[0] = LATE_NS
    assert subscriber.lost == {"tof/depth/image": 2}


def test_closing_wakes_the_reader(headers):
    subscriber = FrameSubscriber(LoopbackBus(), [("tof", "depth")], time.monotonic_ns)
    reader = threading.Thread(target=subscriber.take)
    reader.start()
    subscriber.close()
    reader.join(5)
    assert not reader.is_alive()
