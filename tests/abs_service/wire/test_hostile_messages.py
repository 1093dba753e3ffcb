"""Hostile messages: none ends a process, recorder and tracker behind the edge."""

import threading
import time

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health as Message
from absmsg.v1.sensor_model_pb2 import SensorModel
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.bus.clock_offsets import NO_OFFSET, ClockOffsets
from abs_service.bus.contract import Sample
from abs_service.bus.frames import FrameSubscriber
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.processes import track
from abs_service.pairing.common_clock import CommonClock
from abs_service.pairing.frame_set_queue import FrameSetQueue
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.pairing.waiting_stream import FOREIGN
from abs_service.recording.recorder import Recorder
from abs_service.recording.recorder_settings import RecorderSettings
from abs_service.wire.checked_bus import CheckedBus
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding import codec, encoded_image
from drivers.encoding.encoded_image import ImageCodec
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.recording.recorder_rig import depth, read, recordings
from tests.abs_service.wire.hostile import MODEL, TOPICS, samples
from tests.abs_service.wire.test_edge import sample
from tests.waiting import eventually

HOSTILE = st.lists(samples(), min_size=1, max_size=5)
S = 1_000_000_000


@pytest.fixture(autouse=True)
def _at_once(monkeypatch):
    """Messages are there as soon as they are delivered, so that nobody has to wait for one."""
    monkeypatch.setattr("abs_service.pairing.frame_set_queue.POLL_S", 0.0)


class Recording:
    """A recorder of a rig, and its health."""

    def __init__(self, directory):
        self.directory = directory
        self.bus, self.health_bus = LoopbackBus(), LoopbackBus()
        clock = WallClock()
        self.health = Health(self.health_bus, "record", HeaderFactory("demo", clock))
        encode = encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.RAW)
        rig = RecorderSettings(directory, "demo", "version = 1\n", encode, minimum_free_bytes=0)
        self.recorder = Recorder(CheckedBus(self.bus, clock.monotonic), rig, self.health, clock)

    def record(self, *hostile):
        self.recorder.start()
        for one in hostile:
            self.bus.deliver(one)
        assert eventually(lambda: any(self.directory.iterdir()))  # stopped before it began, it writes no file
        self.recorder.stop(10)
        self.recorder.report()
        return health_now(self.health, self.health_bus)


class TestRecorder:
    def test_a_sensor_model_of_an_absurd_year(self, tmp_path):
        absurd = SensorModel(header=Header(stamp={"seconds": 10**12}), sensor="tof")
        absurd.MergeFrom(MODEL)
        recording = Recording(tmp_path)
        recording.record(sample("tof/model", absurd), sample("tof/model", MODEL))
        assert recording.recorder.failed == ""
        assert [m.channel.topic for m in read(recordings(tmp_path)[0])[0]] == ["/tof/model"]

    def test_sequence_numbers_that_jump_between_the_ends_of_their_range(self, tmp_path):
        jumps = [Message(component="run", header=Header(seq=seq)) for seq in (0, 2**64 - 1, 0, 2**62, 0, 2**62)]
        said = Recording(tmp_path).record(*(sample("health/run", one) for one in jumps))
        assert said.counters["recorded"] == 5
        assert said.counters["missing.health/run"] == 0

    @settings(max_examples=100)
    @given(HOSTILE)
    def test_nothing_ends_it(self, tmp_path_factory, hostile):
        directory = tmp_path_factory.mktemp("recording")
        recording = Recording(directory)
        recording.record(*hostile)
        assert recording.recorder.failed == ""
        assert len(recordings(directory)) == 1


class Tracking:
    """Input of a tracker from the bus: frame sets of one depth stream."""

    def __init__(self):
        self.bus, self.headers = LoopbackBus(), HeaderFactory("demo", WallClock())
        checked = CheckedBus(self.bus, time.monotonic_ns)
        frames = FrameSubscriber(checked, [("tof", "depth")], time.monotonic_ns)
        key = ("tof", "depth")
        common_clock = CommonClock(key, 12_000_000, lambda _: NO_OFFSET)
        self.sets = FrameSetQueue(frames, common_clock, Synchroniser(key, [key], 12_000_000), time.monotonic_ns)

    def publish(self, seq, epoch=0, t_ns=None):
        t_ns = seq * S // 30 if t_ns is None else t_ns
        image = depth(seq)
        frame = Frame("tof", "depth", Kind.DEPTH, image.data, "16UC1", t_ns, t_ns, seq, epoch, geometry=Geometry.RADIAL)
        info = codec.encode_info(frame, self.headers.at(t_ns, seq))
        self.bus.deliver(Sample("tof/depth/image", codec.IMAGE_SCHEMA, codec.encode_image(frame, 0), info))
        return self.sets.take()


class TestTracker:
    @pytest.mark.parametrize("wrong", [{"epoch": 2**32 - 1}, {"t_ns": 2**61}])
    def test_goes_on_after_a_frame_of_a_huge_epoch_or_time(self, wrong):
        tracking = Tracking()
        assert tracking.publish(0) is not None
        tracking.publish(1, **wrong)
        taken = [tracking.publish(seq) is not None for seq in range(2, 2 + 2 * FOREIGN)]
        assert taken == [False] * FOREIGN + [True] * FOREIGN

    def test_waits_for_a_camera_that_is_one(self):
        bus, stop = LoopbackBus(), threading.Event()
        health = Health(LoopbackBus(), "track/sheet", HeaderFactory("demo", WallClock()))
        answers = iter([SensorModel(sensor="tof"), SensorModel(), MODEL])
        bus.answer_queries("tof/model", MODEL.DESCRIPTOR.full_name, lambda: next(answers).SerializeToString())
        cameras = track.await_cameras(CheckedBus(bus, time.monotonic_ns), ("tof",), health, stop)
        assert cameras["tof"].width == MODEL.width

    @given(st.lists(samples(("tof/depth/image",)), min_size=1, max_size=5))
    def test_nothing_ends_it(self, hostile):
        tracking = Tracking()
        for one in hostile:
            tracking.bus.deliver(one)
            tracking.sets.take()
        bus = LoopbackBus()
        health = Health(bus, "track/sheet", tracking.headers)
        health.count_up_to(tracking.sets.counters)
        assert health_now(health, bus).component == "track/sheet"

    @given(st.lists(samples(("clock/there",)), min_size=1, max_size=5))
    def test_no_answer_of_a_clock_ends_it(self, answers):
        bus = LoopbackBus()
        bus.query = lambda pattern, timeout_s: answers
        clocks = ClockOffsets(CheckedBus(bus, time.monotonic_ns), time.monotonic_ns, "here")
        assert clocks.offset("there") is None
        clocks.measure()
        known = clocks.offset("there")
        assert known is None or known.error_ns >= 0


def test_every_kind_of_key_is_among_the_topics():
    from abs_service.bus import keys

    assert {topic.partition("/")[0] for topic in TOPICS} >= keys.RESERVED
