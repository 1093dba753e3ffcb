"""Selection of stream profiles, and their cameras."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib import pose
from calib.camera import Camera
from drivers.contract.device import DeviceError
from drivers.contract.frame import Kind
from drivers.realsense.address import Address, Mode
from drivers.realsense.picture import FORMATS
from drivers.realsense.streams import Role, StreamError, camera, role_beside

#: Requested mode of a stream, by its kind; None if it is not wanted.
_MODES: Mapping[Kind, Callable[[Address], Mode | None]] = {
    Kind.DEPTH: lambda address: address.depth,
    Kind.COLOR: lambda address: address.color,
    Kind.IR: lambda address: address.ir,
    Kind.CONFIDENCE: lambda address: address.confidence,
}


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A stream in use: its role, its `rs.video_stream_profile`, and encoding."""

    role: Role
    profile: Any
    encoding: str


def of_sensor(sensor: Any) -> list[Stream]:
    """All supported stream profiles of a sensor."""
    found = []
    profiles = sensor.get_stream_profiles()
    kinds = {profile.stream_type().name for profile in profiles}
    for profile in profiles:
        # A single colour or depth stream has index 0; infra-red of a software device may have index 0.
        role = role_beside((profile.stream_type().name, profile.stream_index()), kinds)
        if role is not None and profile.is_video_stream_profile() and profile.format().name in FORMATS[role.kind]:
            encoding = FORMATS[role.kind][profile.format().name]
            found.append(Stream(role, profile.as_video_stream_profile(), encoding))
    return found


def wanted(offers: Sequence[Stream], address: Address) -> list[Stream]:
    """Profiles requested by an address: each stream once, formats in the order of preference of `FORMATS`.

    Every stream may have a mode of its own; librealsense refuses what a sensor cannot stream together when opening it.

    Raises:
        DeviceError: an unsupported size or rate; names the supported ones.
    """
    chosen = []
    for role in dict.fromkeys(offer.role for offer in offers):
        mode = _MODES[role.kind](address)
        if mode is None:
            continue
        fitting = [offer for offer in offers if offer.role == role and _mode(offer.profile) == mode]
        if not fitting:
            there_are = ", ".join(map(_text, sorted({_mode(offer.profile) for offer in offers if offer.role == role})))
            raise DeviceError(f"{address.uri}: {role.sensor}/{role.stream} has no {_text(mode)}; it has: {there_are}")
        preferred = list(FORMATS[role.kind])
        chosen.append(min(fitting, key=lambda offer: preferred.index(offer.profile.format().name)))
    return chosen


def cameras(streams: Iterable[Stream]) -> Mapping[str, Camera]:
    """Cameras by head; the rig's frame is that of depth, or of the first stream without depth.

    Raises:
        StreamError: an invalid camera, or streams of one head that differ in size.
    """
    first: dict[str, Any] = {}
    for stream in streams:
        sensor, profile = stream.role.sensor, stream.profile
        size, width, height = _mode(first.setdefault(sensor, profile))[:2], profile.width(), profile.height()
        if size != (width, height):
            name, theirs = f"{sensor}/{stream.role.stream}", f"{size[0]}x{size[1]}"
            raise StreamError(
                f"{name} has {width}x{height} pixels and the others of its head {theirs}: choose one size"
            )
    reference = first.get("depth", next(iter(first.values()), None))
    return {sensor: _camera(sensor, profile, reference) for sensor, profile in first.items()}


def _camera(sensor: str, profile: Any, reference: Any) -> Camera:
    intrinsics = profile.get_intrinsics()
    size, matrix = (intrinsics.width, intrinsics.height), (intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy)
    T_rs = pose.identity()
    if profile is not reference:
        extrinsics = profile.get_extrinsics_to(reference)
        # Rotations are stored in column-major order.
        T_rs = pose.from_rotation(np.reshape(extrinsics.rotation, (3, 3)).T, extrinsics.translation)
    return camera(sensor, size, matrix, intrinsics.model.name.replace("_", " "), intrinsics.coeffs, T_rs)


def _mode(profile: Any) -> Mode:
    return profile.width(), profile.height(), profile.fps()


def _text(mode: Mode) -> str:
    width, height, fps = mode
    return f"{width}x{height} at {fps}"
