"""A rig on a loopback bus with a recorder, and how to read what it recorded."""

import time

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from abs_service.bus import keys
from abs_service.bus.contract import IMAGES
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.recording.recorder import Recorder
from abs_service.recording.recorder_settings import RecorderSettings
from abs_service.recording.recording_file import open_for_writing
from abs_service.recording.triggers.trigger import ALWAYS, Trigger
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding import codec
from tests.abs_service.bus.loopback import LoopbackBus, health_now

#: Time between two attempts to record after a failure [s].
RETRY_S = 0.02
DEPTH = keys.image("tof", "depth")


class Rig:
    """A rig on a loopback bus, with a recorder."""

    def __init__(
        self,
        directory,
        free_bytes=lambda folder: 1 << 40,
        open_file=open_for_writing,
        trigger: Trigger = ALWAYS,
        monotonic=time.monotonic_ns,
        **settings,
    ):
        self.bus = LoopbackBus()
        self.steps_ns = 0
        self.clock = WallClock(monotonic, lambda: time.time_ns() + self.steps_ns)
        self.headers = HeaderFactory("demo", self.clock)
        self.health = Health(self.bus, "record", self.headers)
        settings = RecorderSettings(directory, "demo", "version = 1\n", **settings)
        self.recorder = Recorder(self.bus, settings, self.health, self.clock, open_file, free_bytes, RETRY_S, trigger)

    def publish_image(self, frame):
        header = self.headers.at(frame.t_host_ns, frame.seq)
        image = codec.encode_image(frame, self.clock.wall(frame.t_host_ns))
        info = codec.encode_info(frame, header)
        self.bus.publisher(keys.image(frame.sensor, frame.stream), codec.IMAGE_SCHEMA, IMAGES).put(image, info)
        return image, info

    def written(self, count):
        """True once so many messages have been recorded."""
        return self.said.counters["recorded"] >= count

    @property
    def said(self):
        """The health; asked for after the recorder's end, because a recorder records it, too."""
        return health_now(self.health, self.bus)


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


def sequences(directory):
    """Numbers of all depth images in the recordings of a folder, in their order."""
    return sorted(
        m.message.sequence for p in recordings(directory) for m in read(p)[0] if m.channel.topic == f"/{DEPTH}"
    )
