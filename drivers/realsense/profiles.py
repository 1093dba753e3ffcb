"""Selection of stream profiles, and their cameras."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib import pose
from calib.camera import Camera
from drivers.contract.device import DeviceError
from drivers.contract.frame import Kind
from drivers.realsense.address import Address
from drivers.realsense.picture import FORMATS
from drivers.realsense.streams import ROLES, Role, camera


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A stream in use: its role, its `rs.video_stream_profile`, and encoding."""

    role: Role
    profile: Any
    encoding: str


def of_sensor(sensor: Any) -> list[Stream]:
    """All supported stream profiles of a sensor."""
    found = []
    for profile in sensor.get_stream_profiles():
        kind = profile.stream_type().name
        # A single colour or depth stream has index 0; infra-red of a software device may have index 0.
        role = ROLES.get((kind, profile.stream_index()))
        if role is not None and profile.is_video_stream_profile() and profile.format().name in FORMATS[role.kind]:
            encoding = FORMATS[role.kind][profile.format().name]
            found.append(Stream(role, profile.as_video_stream_profile(), encoding))
    return found


def wanted(offers: Sequence[Stream], address: Address) -> list[Stream]:
    """Profiles requested by an address: each stream once, formats in the order of preference of `FORMATS`.

    Raises:
        DeviceError: an unsupported size or rate; names the supported ones.
    """
    chosen = []
    for role in dict.fromkeys(offer.role for offer in offers):
        size = address.color if role.kind == Kind.COLOR else address.depth
        if size is None or (role.kind == Kind.IR and not address.ir):
            continue
        fitting = [offer for offer in offers if offer.role == role and _mode(offer) == (*size, address.fps)]
        if not fitting:
            modes = sorted({_mode(offer) for offer in offers if offer.role == role})
            there_are = ", ".join(f"{width}x{height} at {fps}" for width, height, fps in modes)
            name, asked = f"{role.sensor}/{role.stream}", f"{size[0]}x{size[1]} at {address.fps}"
            raise DeviceError(f"{address.uri}: {name} has no {asked}; it has: {there_are}")
        preferred = list(FORMATS[role.kind])
        chosen.append(min(fitting, key=lambda offer: preferred.index(offer.profile.format().name)))
    return chosen


def cameras(streams: Iterable[Stream]) -> Mapping[str, Camera]:
    """Cameras by head; the rig's frame is that of depth, or of the first stream without depth.

    Raises:
        StreamError: an invalid camera.
    """
    first: dict[str, Any] = {}
    for stream in streams:
        first.setdefault(stream.role.sensor, stream.profile)
    reference = first.get("depth", next(iter(first.values()), None))
    return {sensor: _camera(sensor, profile, reference) for sensor, profile in first.items()}


def _camera(sensor: str, profile: Any, reference: Any) -> Camera:
    intrinsics = profile.get_intrinsics()
    size, matrix = (intrinsics.width, intrinsics.height), (intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy)
    T_rs = pose.identity()
    if sensor != "depth" and profile is not reference:
        extrinsics = profile.get_extrinsics_to(reference)
        # Rotations are stored in column-major order.
        T_rs = pose.from_rotation(np.reshape(extrinsics.rotation, (3, 3)).T, extrinsics.translation)
    return camera(sensor, size, matrix, intrinsics.model.name.replace("_", " "), intrinsics.coeffs, T_rs)


def _mode(offer: Stream) -> tuple[int, int, int]:
    return offer.profile.width(), offer.profile.height(), offer.profile.fps()
