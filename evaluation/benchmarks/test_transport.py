"""Time to transport and to record one exposure: depth and amplitude of 176 × 144, colour of 320 × 240."""

import socket
import time

import numpy as np
import pytest

from abs_service.bus import keys
from abs_service.bus.frames import FramePublisher, FrameSubscriber
from abs_service.bus.session import SessionMode
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.recording.recording_file import RecordingFile
from abs_service.wire import message_header
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding import codec

CLOCK = WallClock()
SPEAKER = HeaderFactory("demo", CLOCK)
STREAMS = {
    ("tof", "depth"): (Kind.DEPTH, "16UC1", (144, 176)),
    ("tof", "amplitude"): (Kind.AMPLITUDE, "16UC1", (144, 176)),
    ("color", "color"): (Kind.COLOR, "rgb8", (240, 320, 3)),
}


class Exposures:
    """Frames of all streams, exposure after exposure, with pixels that do not compress."""

    def __init__(self):
        generator = np.random.default_rng(1)
        self._pixels = {
            key: generator.integers(0, 256, shape).astype("u1" if encoding == "rgb8" else "<u2")
            for key, (_, encoding, shape) in STREAMS.items()
        }
        self._seq = 0

    def next(self):
        self._seq += 1
        now_ns = CLOCK.monotonic()
        return [
            Frame(
                *(sensor, stream, kind, self._pixels[sensor, stream], encoding, now_ns, now_ns, self._seq),
                geometry=Geometry.RADIAL if kind == Kind.DEPTH else Geometry.NONE,
            )
            for (sensor, stream), (kind, encoding, _) in STREAMS.items()
        ]


@pytest.fixture
def open_bus():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    opened = []

    def open_bus():
        opened.append(ZenohBus.open("demo", endpoint, SessionMode.CLIENT if opened else SessionMode.ROUTER))
        return opened[-1]

    yield open_bus
    for bus in reversed(opened):
        bus.close()


def test_from_a_device_to_the_frames_of_a_reader(benchmark, open_bus):
    open_bus()
    subscriber = FrameSubscriber(open_bus(), STREAMS, time.monotonic_ns)
    exposures = Exposures()
    with FramePublisher(open_bus(), SPEAKER, "sim") as sink:

        def move():
            for frame in exposures.next():
                sink.on_frame(frame)
            return [subscriber.take(1.0) for _ in STREAMS]

        while None in move():
            pass  # the subscription is on its way
        assert None not in benchmark(move)


def test_into_a_recording(benchmark, tmp_path):
    file = RecordingFile(tmp_path / "demo.mcap", CLOCK.wall(CLOCK.monotonic()), {})
    exposures = Exposures()

    def write():
        for frame in exposures.next():
            topic, stamp_ns = keys.image(frame.sensor, frame.stream), CLOCK.wall(frame.t_host_ns)
            info = codec.encode_info(frame, SPEAKER.at(frame.t_host_ns, frame.seq))
            file.write(topic, message_header.IMAGE, codec.encode_image(frame, stamp_ns), stamp_ns, frame.seq)
            file.write(keys.info(topic), message_header.INFO, info, stamp_ns, frame.seq)

    benchmark(write)
    assert file.finish({}).stat().st_size > 0


def test_into_a_frame_set(benchmark):
    synchroniser = Synchroniser(("tof", "depth"), STREAMS, 12_000_000)
    exposures = Exposures()
    sets = benchmark(lambda: [formed for frame in exposures.next() for formed in synchroniser.add(frame)])
    assert len(sets) == 1
    assert not sets[0].missing
