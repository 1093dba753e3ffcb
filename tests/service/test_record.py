"""What the recorder promises: everything, unchanged, readable by anyone; and never silence about what is missing."""

import queue
import threading
from collections import Counter

import numpy as np
import pytest
from abs.v1 import frame_info_pb2
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from abs_service import announcements, envelope, keys
from abs_service.bus.contract import EVENTS, IMAGES, Sample
from abs_service.health import Health
from abs_service.record import Recorder, RecorderSettings
from abs_service.recording_file import open_for_writing
from abs_service.stamps import Speaker, WallClock
from calib.camera import Camera
from drivers import codec
from drivers.frame import Frame, Geometry, Kind
from tests.service.loopback import LoopbackBus

DEPTH = keys.image("tof", "depth")


class Rig:
    """A rig on a loopback bus, with a recorder."""

    def __init__(self, directory, free_bytes=lambda folder: 1 << 40, open_file=open_for_writing, **settings):
        self.bus = LoopbackBus()
        self.clock = WallClock()
        self.speaker = Speaker("demo", self.clock)
        self.health = Health(self.bus, "record", self.speaker)
        settings = RecorderSettings(directory, "demo", "version = 1\n", **settings)
        self.recorder = Recorder(self.bus, settings, self.health, self.clock, open_file, free_bytes)

    def publish_image(self, frame):
        header = self.speaker.header(frame.t_host_ns, frame.seq)
        image = codec.encode_image(frame, self.clock.wall(frame.t_host_ns))
        info = codec.encode_info(frame, header)
        self.bus.publisher(keys.image(frame.sensor, frame.stream), codec.IMAGE_SCHEMA, IMAGES).put(image, info)
        return image, info

    @property
    def said(self):
        return Counter(self.health._counters), self.health._conditions


def depth(seq, stream="depth"):
    return Frame(
        "tof",
        stream,
        Kind.DEPTH,
        np.full((24, 32), seq % 1000, "<u2"),
        "16UC1",
        seq,
        seq,
        seq,
        geometry=Geometry.RADIAL,
    )


def read(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = list(reader.iter_decoded_messages())
        return messages, {a.name: a.data for a in reader.iter_attachments()}, list(reader.iter_metadata())


def metadata(path, name="abs.recording"):
    return next(record.metadata for record in read(path)[2] if record.name == name)


def recordings(directory):
    return sorted(directory.glob("*.mcap"))


def test_a_recording_holds_what_was_published_byte_for_byte(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    published = [rig.publish_image(depth(10**9 + seq)) for seq in range(5)]
    rig.health.publish()
    rig.recorder.stop(5)
    (path,) = recordings(tmp_path)
    messages, attachments, _ = read(path)
    assert attachments == {"rig.toml": b"version = 1\n"}
    images = [m for m in messages if m.channel.topic == "/tof/depth/image"]
    infos = [m for m in messages if m.channel.topic == "/tof/depth/info"]
    assert [(image.message.data, info.message.data) for image, info in zip(images, infos)] == published
    for image, info in zip(images, infos):
        stamp_ns = frame_info_pb2.FrameInfo.FromString(info.message.data).header.stamp.ToNanoseconds()
        assert image.message.log_time == image.message.publish_time == info.message.log_time == stamp_ns
        assert image.message.sequence == info.message.sequence
    assert [m.message.sequence for m in images] == [(10**9 + seq) & 0xFFFFFFFF for seq in range(5)]
    assert {m.schema and m.schema.name for m in messages} == {"foxglove.RawImage", "abs.v1.FrameInfo", "abs.v1.Health"}
    assert metadata(path) == {"ended": "stopped", "messages.tof/depth/image": "5", "messages.health/record": "1"}


def test_it_begins_with_what_was_announced_before_it_came_and_repeats_it_in_every_file(tmp_path):
    rig = Rig(tmp_path, rotate_bytes=1, flush_s=0.001)
    camera = Camera(176, 144, 220.0, 220.0, 87.5, 71.5)
    header = rig.speaker.now(0)
    for topic, message in {
        keys.CONFIG: announcements.config(header, "version = 1"),
        keys.calibration("tof"): announcements.calibration("tof", camera, 1),
        keys.model("tof"): announcements.sensor_model(header, "tof", camera, {"type": "x", "sigma": [[1, 2], [3, 4]]}),
        keys.TRANSFORMS: announcements.transforms({"tof": camera}, 1),
    }.items():
        rig.bus.announce(topic, message.DESCRIPTOR.full_name).put(message.SerializeToString())
    rig.bus.answer(keys.SCHEMA, announcements.SCHEMA_MESSAGE, announcements.schema)
    rig.recorder.start()
    seq = 0
    while len(recordings(tmp_path)) < 2:
        seq += 1
        rig.publish_image(depth(seq))
        threading.Event().wait(0.005)
    rig.recorder.stop(5)
    for path in recordings(tmp_path):
        topics = [m.channel.topic for m in read(path)[0]]
        assert {"/config", "/tof/calibration", "/tof/model", "/tf"} <= set(topics)
    assert metadata(recordings(tmp_path)[0])["ended"] == "rotated"
    frames = [m.message.sequence for p in recordings(tmp_path) for m in read(p)[0] if m.channel.topic == f"/{DEPTH}"]
    assert sorted(frames) == list(range(1, seq + 1)), "rotation lost or doubled a frame"


def test_what_is_no_message_of_ours_is_refused_and_does_not_end_the_recording(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    rig.publish_image(depth(1))
    rig.bus.deliver(Sample("x/y", "", b"1"))
    rig.bus.deliver(Sample("x/y", "their.Message", b"1"))
    rig.bus.deliver(Sample("health/x", "abs.v1.Health", b"\xff\xff\xff"))
    rig.bus.deliver(Sample(DEPTH, "abs.v1.Health", b""))
    rig.bus.deliver(Sample(DEPTH, codec.IMAGE_SCHEMA, b"", b"\xff\xff"))
    rig.publish_image(depth(2))
    rig.recorder.stop(5)
    counters, _ = rig.said
    assert counters["refused"] == 5
    assert counters["recorded"] == 2
    assert not rig.recorder.failed
    assert [m.message.sequence for m in read(recordings(tmp_path)[0])[0] if m.channel.topic == f"/{DEPTH}"] == [1, 2]


@pytest.mark.parametrize("seconds", [-1, 0, 253402300799, 1 << 62])
def test_absurd_stamps_are_replaced_by_the_present(tmp_path, seconds):
    rig = Rig(tmp_path)
    rig.recorder.start()
    before = rig.clock.wall(rig.clock.monotonic())
    info = frame_info_pb2.FrameInfo(seq=1)
    info.header.stamp.seconds = seconds
    rig.bus.deliver(Sample(DEPTH, codec.IMAGE_SCHEMA, b"", info.SerializeToString()))
    rig.recorder.stop(5)
    image, _ = read(recordings(tmp_path)[0])[0]
    assert before <= image.message.log_time <= before + 10**10 or image.message.log_time == seconds * 10**9


def test_gaps_in_the_numbers_are_counted_by_topic(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    for seq in (1, 2, 5, 6, 0, 1, 3):
        rig.publish_image(depth(seq))
    rig.recorder.stop(5)
    assert metadata(recordings(tmp_path)[0])[f"missing.{DEPTH}"] == "3"


class SlowFile:
    """A disk that takes nothing until it is released."""

    def __init__(self, path):
        self._file = path.open("xb")
        self.entered, self.release = queue.SimpleQueue(), threading.Event()
        self.release.set()

    def write(self, data):
        if not self.release.is_set():
            self.entered.put(None)
            self.release.wait()
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)


def test_a_slow_disk_costs_a_bounded_queue_and_every_drop_is_counted(tmp_path):
    files = []

    def slow(path):
        files.append(SlowFile(path))
        return files[-1]

    rig = Rig(tmp_path, open_file=slow, queue_bytes=20_000, flush_s=0.01)
    rig.recorder.start()
    while not files:
        threading.Event().wait(0.001)
    files[0].release.clear()
    rig.publish_image(depth(0))
    files[0].entered.get(timeout=5)
    for seq in range(1, 101):
        rig.publish_image(depth(seq))
    rig.recorder.report()
    counters, conditions = rig.said
    dropped = counters[f"dropped.{DEPTH}"]
    assert 80 < dropped < 100
    assert conditions["queue"][1] == f"the disk is too slow: {dropped} messages dropped"
    files[0].release.set()
    rig.recorder.stop(5)
    (path,) = recordings(tmp_path)
    written = [m for m in read(path)[0] if m.channel.topic == f"/{DEPTH}"]
    assert len(written) + dropped == 101
    assert metadata(path)[f"dropped.{DEPTH}"] == str(dropped)


def test_it_stops_before_the_disk_is_full_with_a_complete_file(tmp_path):
    free = iter([10**9, 10**9, 999])
    rig = Rig(tmp_path, free_bytes=lambda folder: next(free, 999), minimum_free_bytes=1000, flush_s=0.005)
    rig.recorder.start()
    rig.publish_image(depth(1))
    rig.recorder._thread.join(5)
    assert rig.recorder.failed.startswith("only 0 MB free in")
    assert rig.said[1]["record"][1].startswith("RECORD_FAILED only 0 MB free")
    (path,) = recordings(tmp_path)
    assert metadata(path)["ended"] == "low space"
    rig.recorder.stop(5)


def test_a_disk_error_is_said_at_once_and_leaves_the_file_to_be_recovered(tmp_path):
    class Full(SlowFile):
        def write(self, data):
            if self._file.tell() > 5000:
                raise OSError(28, "No space left on device")
            return self._file.write(data)

    rig = Rig(tmp_path, open_file=Full, flush_s=0.005)
    rig.recorder.start()
    seq = 0
    while rig.recorder._thread.is_alive():
        rig.publish_image(depth(seq := seq + 1))
        threading.Event().wait(0.001)
    assert rig.recorder.failed == "[Errno 28] No space left on device"
    assert rig.said[1]["record"][1] == "RECORD_FAILED [Errno 28] No space left on device"
    assert recordings(tmp_path) == []
    assert len(list(tmp_path.glob("*.mcap.active"))) == 1
    rig.publish_image(depth(0))  # harmless
    rig.recorder.stop(5)


def test_a_folder_that_is_gone_is_an_error_like_any_other(tmp_path):
    rig = Rig(tmp_path / "nowhere")
    rig.recorder.start()
    rig.recorder._thread.join(5)
    assert "No such file or directory" in rig.recorder.failed
    rig.recorder.stop(5)


def test_messages_of_every_type_have_an_envelope():
    for message in envelope.MESSAGES - {envelope.INFO}:
        envelope.read(Sample("x", message, b"", b""))
    with pytest.raises(envelope.EnvelopeError, match="is none of"):
        envelope.read(Sample("x", "google.protobuf.Timestamp", b""))
    assert EVENTS.history == 0
