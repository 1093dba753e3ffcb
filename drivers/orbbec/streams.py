"""Streams of Orbbec's sensors: heads, names, formats and modes."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from drivers.contract.device import DeviceError
from drivers.contract.frame import Geometry, Kind
from drivers.orbbec.address import Address, Mode


class StreamError(ValueError):
    """An unusable stream; names it and the problem."""


@dataclass(frozen=True, slots=True)
class Role:
    """Head, name and properties of a stream.

    Attributes:
        sensor: the head.
        stream: its name.
        kind: kind of image.
        geometry: type of distance of depth.
    """

    sensor: str
    stream: str
    kind: Kind
    geometry: Geometry = Geometry.NONE


#: By the SDK's type of sensor. Femto cameras make depth and infra-red of one imager; Gemini cameras have two and give
#: depth as one of them sees it.
ROLES: Mapping[str, Role] = {
    "DEPTH_SENSOR": Role("depth", "depth", Kind.DEPTH, Geometry.Z),
    "IR_SENSOR": Role("depth", "ir", Kind.IR),
    "CONFIDENCE_SENSOR": Role("depth", "confidence", Kind.CONFIDENCE),
    "LEFT_IR_SENSOR": Role("left", "ir", Kind.IR),
    "RIGHT_IR_SENSOR": Role("right", "ir", Kind.IR),
    "COLOR_SENSOR": Role("color", "color", Kind.COLOR),
}

#: The SDK's formats and the corresponding frame encodings, by kind, in the order of preference.
FORMATS: Mapping[Kind, Mapping[str, str]] = {
    Kind.DEPTH: {"Y16": "16UC1", "Z16": "16UC1"},
    Kind.IR: {"Y16": "mono16", "Y8": "mono8"},
    Kind.CONFIDENCE: {"Y16": "mono16", "Y8": "mono8"},
    Kind.COLOR: {"RGB": "rgb8", "BGR": "bgr8"},
}

#: Requested mode of a stream, by its kind; None if it is not wanted.
_MODES: Mapping[Kind, Callable[[Address], Mode | None]] = {
    Kind.DEPTH: lambda address: address.depth,
    Kind.IR: lambda address: address.ir,
    Kind.COLOR: lambda address: address.color,
    Kind.CONFIDENCE: lambda address: address.confidence,
}


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A stream in use: its role, its sensor and profile in the SDK, and encoding."""

    role: Role
    sensor: Any
    profile: Any
    encoding: str


def wanted(camera: Any, address: Address) -> list[Stream]:
    """Streams of a camera that an address asks for, each once.

    Streams of one head have the size of its first: depth decides for the infra-red beside it.

    Raises:
        DeviceError: an unsupported size or rate (names the supported ones), or no stream at all.
    """
    chosen: list[Stream] = []
    for sensor in _sensors(camera):
        role, mode = ROLES[sensor.get_type().name], _MODES[ROLES[sensor.get_type().name].kind](address)
        if mode is None:
            continue
        beside = next((one.profile for one in chosen if one.role.sensor == role.sensor), None)
        if beside is not None and not mode.width:
            mode = Mode(beside.get_width(), beside.get_height(), mode.rate_hz or beside.get_fps())
        chosen.append(_stream(sensor, role, mode, address.uri))
    if not chosen:
        raise DeviceError(f"{address.uri}: it has no stream of depth, infra-red, confidence or colour")
    return chosen


def _sensors(camera: Any) -> list[Any]:
    """Supported sensors in the order of `ROLES`."""
    sensors = camera.get_sensor_list()
    found = [sensors.get_sensor_by_index(number) for number in range(sensors.get_count())]
    order = list(ROLES)
    known = [sensor for sensor in found if sensor.get_type().name in ROLES]
    return sorted(known, key=lambda sensor: order.index(sensor.get_type().name))


def _stream(sensor: Any, role: Role, mode: Mode, uri: str) -> Stream:
    profiles = sensor.get_stream_profile_list()
    preferred = profiles.get_default_video_stream_profile()
    usable = [profile for profile in _videos(profiles) if profile.get_format().name in FORMATS[role.kind]]
    fitting = [profile for profile in usable if _fits(profile, mode)]
    if not fitting:
        there_are = ", ".join(f"{w}x{h}@{rate}" for w, h, rate in sorted(set(map(_size_and_rate, usable)))) or "none"
        requested = f"{mode.width}x{mode.height}" + (f"@{mode.rate_hz}" if mode.rate_hz else "")
        raise DeviceError(f"{uri}: {role.sensor}/{role.stream} has no {requested}; it has: {there_are}")
    best = min(fitting, key=lambda profile: _rank(profile, preferred, list(FORMATS[role.kind])))
    return Stream(role, sensor, best, FORMATS[role.kind][best.get_format().name])


def _videos(profiles: Any) -> Iterable[Any]:
    for number in range(profiles.get_count()):
        profile = profiles.get_stream_profile_by_index(number)
        if profile.is_video_stream_profile():
            yield profile.as_video_stream_profile()


def _fits(profile: Any, mode: Mode) -> bool:
    pairs = zip((mode.width, mode.height, mode.rate_hz), _size_and_rate(profile), strict=True)
    return all(requested in {0, given} for requested, given in pairs)


def _rank(profile: Any, preferred: Any, formats: Sequence[str]) -> tuple[bool, bool, int]:
    """Order of profiles that fit: the size and rate of the camera's default first, then the preferred format."""
    size, rate = _size_and_rate(profile)[:2], profile.get_fps()
    default = _size_and_rate(preferred)
    return size != default[:2], rate != default[2], formats.index(profile.get_format().name)


def _size_and_rate(profile: Any) -> tuple[int, int, int]:
    return profile.get_width(), profile.get_height(), profile.get_fps()
