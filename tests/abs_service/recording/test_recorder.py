"""The recorder writes all messages, unchanged, in a standard format."""

import json
import threading
from dataclasses import replace

import pytest
from absmsg.v1 import frame_info_pb2
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import SensorModel
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

from abs_service.bus import keys
from abs_service.bus.contract import IMAGES, Sample
from abs_service.capture import sensor_metadata
from abs_service.wire import message_header
from calib.camera import Camera
from drivers.encoding import codec, encoded_image
from drivers.encoding.encoded_image import ImageCodec
from drivers.replay import Recording
from tests.abs_service.recording.recorder_rig import DEPTH, Rig, depth, metadata, read, recordings, sequences
from tests.waiting import eventually


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
    schemas = {m.schema and m.schema.name for m in messages}
    assert schemas == {"foxglove.RawImage", "absmsg.v1.FrameInfo", "absmsg.v1.Health"}
    assert metadata(path) == {"ended": "stopped", "messages.tof/depth/image": "5", "messages.health/record": "1"}
    assert rig.recorder.written == (path.stat().st_size, 0)
    assert rig.said.gauges["file_bytes"] == path.stat().st_size


@pytest.mark.parametrize("step_s", [-3600, 3600, 31_557_600, -1_700_000_000])
def test_a_step_of_the_wall_clock_changes_the_order_of_no_message_in_the_file(tmp_path, step_s):
    rig = Rig(tmp_path)
    points = PointCloud(frame_id="tof")
    begin_ns = rig.clock.wall(rig.clock.monotonic())
    rig.recorder.start()
    for seq in range(4):
        if seq == 2:
            assert eventually(lambda: rig.written(1))  # the file has begun
            rig.steps_ns = step_s * 10**9
            rig.clock.measure()
        now_ns = rig.clock.monotonic()
        rig.publish_image(replace(depth(seq), t_host_ns=now_ns))
        points.timestamp.FromNanoseconds(rig.clock.wall(now_ns))
        cloud = rig.bus.publisher("tof/depth/points", points.DESCRIPTOR.full_name, IMAGES)
        cloud.put(points.SerializeToString())
    rig.recorder.stop(5)
    (path,) = recordings(tmp_path)
    assert [frame.seq for frame in Recording(path).frames()] == [0, 1, 2, 3]
    times = [message.message.log_time for message in read(path)[0]]
    assert begin_ns <= times[0] <= times[-1] < begin_ns + 60 * 10**9


def test_images_are_recorded_in_the_form_that_the_settings_say(tmp_path):
    rig = Rig(tmp_path, encode_image=encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.RAW))
    rig.recorder.start()
    published = [rig.publish_image(depth(seq)) for seq in range(3)]
    rig.bus.deliver(Sample(DEPTH, codec.IMAGE_SCHEMA, b"\xff\xff", published[0][1]))
    rig.recorder.stop(5)
    assert rig.said.counters["refused"] == 1  # pixels that cannot be decoded do not end the recording
    (path,) = recordings(tmp_path)
    images = [m for m in read(path)[0] if m.channel.topic == f"/{DEPTH}"]
    assert {m.schema and m.schema.name for m in images} == {"absmsg.v1.EncodedImage"}
    decoded = [encoded_image.decode("absmsg.v1.EncodedImage", m.message.data) for m in images]
    assert list(map(RawImage.FromString, decoded)) == [RawImage.FromString(image) for image, _ in published]


def test_it_begins_with_what_was_announced_before_it_came_and_repeats_it_in_every_file(tmp_path):
    rig = Rig(tmp_path, rotate_bytes=1, flush_s=0.001)
    camera = Camera(176, 144, 220.0, 220.0, 87.5, 71.5)
    header = rig.headers.now(0)
    for topic, message in {
        keys.CONFIG: sensor_metadata.config(header, "version = 1"),
        keys.calibration("tof"): sensor_metadata.calibration("tof", camera, 1),
        keys.model("tof"): sensor_metadata.sensor_model(
            header, "tof", camera, {"type": "x", "sigma": [[1, 2], [3, 4]]}
        ),
        keys.TRANSFORMS: sensor_metadata.transforms({"tof": camera}, 1),
    }.items():
        rig.bus.latched_publisher(topic, message.DESCRIPTOR.full_name).put(message.SerializeToString())
    rig.bus.answer_queries(keys.SCHEMA, sensor_metadata.SCHEMA_MESSAGE, sensor_metadata.schema)
    rig.recorder.start()
    seq = 0
    while len(recordings(tmp_path)) < 2:
        seq += 1
        rig.publish_image(depth(seq))
        threading.Event().wait(0.005)
    rig.recorder.stop(5)
    for path in recordings(tmp_path):
        messages, attachments, _ = read(path)
        assert {"/config", "/tof/calibration", "/tof/model", "/tf"} <= {m.channel.topic for m in messages}
        assert json.loads(attachments["calibration/tof.json"])["calib_id"] == camera.calib_id
    assert metadata(recordings(tmp_path)[0])["ended"] == "rotated"
    frames = [m.message.sequence for p in recordings(tmp_path) for m in read(p)[0] if m.channel.topic == f"/{DEPTH}"]
    assert sorted(frames) == list(range(1, seq + 1)), "rotation lost or doubled a frame"


def test_what_is_no_message_of_ours_is_refused_and_does_not_end_the_recording(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    rig.publish_image(depth(1))
    rig.bus.deliver(Sample("x/y", "", b"1"))
    rig.bus.deliver(Sample("x/y", "their.Message", b"1"))
    rig.bus.deliver(Sample("health/x", "absmsg.v1.Health", b"\xff\xff\xff"))
    rig.bus.deliver(Sample(DEPTH, "absmsg.v1.Health", b""))
    rig.bus.deliver(Sample(DEPTH, codec.IMAGE_SCHEMA, b"", b"\xff\xff"))
    rig.publish_image(depth(2))
    rig.recorder.stop(5)
    counters = rig.said.counters
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


def test_a_sensor_whose_name_is_a_path_is_refused(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    model = SensorModel(sensor="../../x", calib_id="1")
    rig.bus.deliver(Sample(keys.model("tof"), message_header.MODEL, model.SerializeToString()))
    rig.recorder.stop(5)
    assert rig.said.counters["refused"] == 1
    assert read(recordings(tmp_path)[0])[1].keys() == {"rig.toml"}


def test_a_sensor_whose_stamp_is_absurd_does_not_end_the_recording(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    model = SensorModel(sensor="tof", calib_id="1")
    model.header.stamp.seconds = 1 << 62
    rig.bus.deliver(Sample(keys.model("tof"), message_header.MODEL, model.SerializeToString()))
    rig.publish_image(depth(1))
    rig.recorder.stop(5)
    assert (rig.said.counters["refused"], rig.recorder.failures) == (1, 0)
    assert sequences(tmp_path) == [1]


def test_a_mistake_of_ours_costs_a_message_and_is_said_but_does_not_end_the_recording(tmp_path, caplog):
    def encode(payload):
        if rig.recorder.failures == 0:
            raise ZeroDivisionError("a mistake")
        return codec.IMAGE_SCHEMA, payload

    rig = Rig(tmp_path, encode_image=encode, flush_s=0.005)
    rig.recorder.start()
    rig.publish_image(depth(1))
    rig.publish_image(depth(2))
    assert eventually(lambda: rig.recorder.failures == 1 and not rig.recorder.failed)
    rig.recorder.stop(5)
    assert rig.said.labels["last_failure"] == "ZeroDivisionError: a mistake"
    assert "a mistake" in caplog.text
    assert sequences(tmp_path) == [2]


def test_gaps_in_the_numbers_are_counted_by_topic(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    for seq in (1, 2, 5, 6, 0, 1, 3):
        rig.publish_image(depth(seq))
    rig.recorder.stop(5)
    assert metadata(recordings(tmp_path)[0])[f"missing.{DEPTH}"] == "3"


def test_images_that_never_came_are_said_once_and_counted(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    said = []
    for seqs in ((1, 2), (5, 7), (8,)):
        for seq in seqs:
            rig.publish_image(depth(seq))
        rig.recorder.report()
        said.append(rig.said)
    rig.recorder.stop(5)
    assert [one.message for one in said] == ["", "3 messages were lost on their way to the recorder", ""]
    assert said[-1].counters[f"lost.{DEPTH}"] == 3


def test_a_topic_of_two_hosts_has_no_gap_where_they_alternate(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    for boot_id, seq in (("here", 1), ("there", 70), ("here", 2), ("there", 71), ("here", 4)):
        health = Health(component="capture", header=Header(boot_id=boot_id, seq=seq))
        rig.bus.deliver(Sample("health/capture", Health.DESCRIPTOR.full_name, health.SerializeToString()))
    rig.recorder.stop(5)
    assert metadata(recordings(tmp_path)[0])["missing.health/capture"] == "1"


def test_messages_of_every_type_have_an_envelope():
    for message in message_header.MESSAGES - {message_header.INFO}:
        message_header.parse(Sample("x", message, b"", b""))
    with pytest.raises(message_header.MessageHeaderError, match="is none of"):
        message_header.parse(Sample("x", "google.protobuf.Timestamp", b""))
