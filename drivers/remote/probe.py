"""Sensors and streams of a remote rig, from its metadata and its first frames."""

import threading
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from absmsg.v1.sensor_model_pb2 import Config, SensorModel

from calib.camera import Camera
from calib.files import nested
from drivers.contract.capabilities import ClockInfo, StreamInfo
from drivers.contract.device import DeviceError, DeviceInfo
from drivers.contract.discovery import Found, choose
from drivers.contract.frame import Frame
from drivers.contract.host_clock import host_clock
from drivers.encoding import codec
from drivers.encoding.message_check import parse_valid
from drivers.encoding.parsing import CodecError
from drivers.encoding.sensor_model import decode_camera
from drivers.remote.address import Address
from drivers.remote.link import Link

IMAGES = "*/*/image"
#: Timeout for the first image [s].
FIRST_S = 5.0


@dataclass(frozen=True, eq=False)
class RemoteRig:
    """Result of `probe`.

    Attributes:
        cameras: calibrations by sensor name, in coordinates of the remote rig.
        streams: the observed streams.
        same_clock: True if their host times are on this host's clock.
    """

    cameras: Mapping[str, Camera]
    streams: tuple[StreamInfo, ...]
    same_clock: bool


def choose_rig(link: Link, address: Address) -> str:
    """Name of the rig that an address refers to.

    Raises:
        DeviceError: no rig of that name, or several rigs.
    """
    found = [Found(DeviceInfo(address.uri(rig), "abs-service rig", rig)) for rig in link.rigs()]
    return choose(found, "remote", address.rig).info.serial


def probe(link: Link, rig: str, address: Address) -> RemoteRig:
    """Queries the sensors of a rig and observes their streams.

    Raises:
        DeviceError: a requested sensor has no metadata or no frames yet, as while its device is being opened.
    """
    wanted = address.sensors or _configured(link, rig)
    models = _models(link, rig, wanted)
    cameras = {name: _camera(rig, model) for name, model in models.items()}
    seen = _Seen()
    link.subscribe(rig, IMAGES, seen.on_message)
    try:
        if seen.first.wait(FIRST_S):
            threading.Event().wait(address.learn_s)
    finally:
        link.unsubscribe()
    streams = tuple(_stream(seen.frames[key]) for key in sorted(seen.frames) if key[0] in cameras)
    silent = sorted(set(wanted) - {stream.sensor for stream in streams})
    if silent:
        raise DeviceError(f'sensor {", ".join(silent)} of rig "{rig}" delivers nothing yet')
    clocks = {model.header.host_clock for model in models.values()}
    return RemoteRig(cameras, streams, same_clock=clocks == {host_clock()} and clocks != {""})


@dataclass
class _Seen:
    """First and latest frame of every stream."""

    frames: dict[tuple[str, str], tuple[Frame, Frame]] = field(default_factory=dict)
    first: threading.Event = field(default_factory=threading.Event)

    def on_message(self, topic: str, payload: bytes, attachment: bytes) -> None:
        try:
            frame = codec.decode(payload, attachment)
        except CodecError:
            return  # counted when the device is started
        self.frames[frame.key] = (self.frames.get(frame.key, (frame,))[0], frame)
        self.first.set()


def _configured(link: Link, rig: str) -> tuple[str, ...]:
    """Sensors in the rig's configuration; their metadata may be published one after the other."""
    try:
        configs = [nested.toml(parse_valid(Config, payload).toml) for payload in link.query(rig, "config")]
    except ValueError as error:
        raise DeviceError(f'rig "{rig}" announces a configuration that is not understood: {error}') from error
    tables = [table for config in configs if isinstance(table := config.get("sensors"), dict)]
    sensors = tuple(sorted({name for table in tables for name in table}))
    if not sensors:
        raise DeviceError(f'rig "{rig}" has announced no sensor yet')
    return sensors


def _models(link: Link, rig: str, wanted: Collection[str]) -> dict[str, SensorModel]:
    """Sensor models of the requested sensors, by name."""
    try:
        models = [parse_valid(SensorModel, payload) for payload in link.query(rig, "*/model")]
    except CodecError as error:
        raise DeviceError(f'rig "{rig}" announces a sensor in a way that is not understood: {error}') from error
    announced = {model.sensor: model for model in models}
    missing = sorted(set(wanted) - set(announced))
    if missing:
        there_are = ", ".join(sorted(announced)) or "none"
        raise DeviceError(f'rig "{rig}" has not announced {", ".join(missing)} yet; announced: {there_are}')
    return {name: announced[name] for name in wanted}


def _camera(rig: str, model: SensorModel) -> Camera:
    try:
        return decode_camera(model)
    except CodecError as error:
        raise DeviceError(f'rig "{rig}": {error}') from error


def _stream(frames: tuple[Frame, Frame]) -> StreamInfo:
    """Stream properties from its first and latest frame; rate 1 Hz after a single frame."""
    first, latest = frames
    height, width = latest.data.shape[:2]
    exposures, elapsed_ns = latest.seq - first.seq, latest.t_host_ns - first.t_host_ns
    rate_hz = exposures * 1e9 / elapsed_ns if exposures > 0 and elapsed_ns > 0 and first.epoch == latest.epoch else 1.0
    clock = ClockInfo(latest.clock_domain, latest.tick_hz)
    # Repeated images are left out where they are captured; those of a simulation may be equal.
    return StreamInfo(*latest.key, latest.kind, latest.encoding, width, height, rate_hz, clock, noisy=False)
