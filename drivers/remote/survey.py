"""What a remote rig delivers: its sensors say it, its streams show it."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from abs.v1.sensor_model_pb2 import SensorModel
from google.protobuf.message import DecodeError

from calib.camera import Camera
from drivers import codec
from drivers.capabilities import ClockInfo, StreamInfo
from drivers.codec import CodecError
from drivers.device import DeviceError, DeviceInfo
from drivers.discovery import Found, choose
from drivers.frame import Frame
from drivers.host_clock import host_clock
from drivers.remote.address import Address
from drivers.remote.link import Link
from drivers.sensor_model import decode_camera

IMAGES = "*/*/image"


@dataclass(frozen=True, eq=False)
class Survey:
    """What was learned.

    Attributes:
        cameras: calibration of every sensor, by name, in the coordinates of its rig.
        streams: those that were seen.
        same_clock: whether their host times are those of this host's clock.
    """

    cameras: Mapping[str, Camera]
    streams: tuple[StreamInfo, ...]
    same_clock: bool


def choose_rig(link: Link, address: Address) -> str:
    """The rig that an address means.

    Raises:
        DeviceError: there is none of that name, or several to choose from.
    """
    found = [Found(DeviceInfo(address.uri(rig), "abs-service rig", rig)) for rig in link.rigs()]
    return choose(found, "remote", address.rig).info.serial


def survey(link: Link, rig: str, learn_s: float, clock: Callable[[], int]) -> Survey:
    """Asks for the sensors of a rig and watches for a while what they deliver.

    Args:
        link: to the rig.
        rig: its name.
        learn_s: time to watch, from the first frame on [s].
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        DeviceError: no sensor is announced, a model is none, or nothing comes.
    """
    models = _models(link, rig)
    cameras = {model.sensor: _camera(rig, model) for model in models}
    seen = _Seen()
    link.listen(rig, IMAGES, seen.on_message)
    try:
        if seen.first.wait(5 + learn_s):
            threading.Event().wait(learn_s)
    finally:
        link.silence()
    streams = tuple(
        stream for key, frames in sorted(seen.frames.items()) if key[0] in cameras for stream in [_stream(frames)]
    )
    if not streams:
        raise DeviceError(f'rig "{rig}" delivers no images; look at its own table or health')
    clocks = {model.host_clock for model in models}
    return Survey(cameras, streams, same_clock=clocks == {host_clock()} and clocks != {""})


@dataclass
class _Seen:
    """The first and the latest frame of every stream, and which exposure that was."""

    frames: dict[tuple[str, str], tuple[Frame, Frame]] = field(default_factory=dict)
    first: threading.Event = field(default_factory=threading.Event)

    def on_message(self, topic: str, payload: bytes, attachment: bytes) -> None:
        try:
            frame = codec.decode(payload, attachment)
        except CodecError:
            return  # counted once the device is started
        self.frames[frame.key] = (self.frames.get(frame.key, (frame,))[0], frame)
        self.first.set()


def _models(link: Link, rig: str) -> list[SensorModel]:
    try:
        models = [SensorModel.FromString(payload) for payload in link.ask(rig, "*/model")]
    except DecodeError as error:
        raise DeviceError(f'rig "{rig}" announces a sensor in a way that is not understood: {error}') from error
    if not models:
        raise DeviceError(f'rig "{rig}" has announced no sensor yet; its devices may still be opening')
    return models


def _camera(rig: str, model: SensorModel) -> Camera:
    try:
        return decode_camera(model)
    except CodecError as error:
        raise DeviceError(f'rig "{rig}": {error}') from error


def _stream(frames: tuple[Frame, Frame]) -> StreamInfo:
    """A stream as its first and latest frame show it; 1 Hz if there was one only."""
    first, latest = frames
    height, width = latest.data.shape[:2]
    exposures, elapsed_ns = latest.seq - first.seq, latest.t_host_ns - first.t_host_ns
    rate_hz = exposures * 1e9 / elapsed_ns if exposures > 0 and elapsed_ns > 0 and first.epoch == latest.epoch else 1.0
    clock = ClockInfo(latest.clock_domain, latest.tick_hz)
    return StreamInfo(*latest.key, latest.kind, latest.encoding, width, height, rate_hz, clock)
