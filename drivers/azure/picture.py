"""Frames from the SDK's captures."""

import ctypes
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.camera import Camera
from drivers.azure.address import FORMATS
from drivers.azure.colors import color
from drivers.contract.capabilities import ClockInfo
from drivers.contract.frame import Frame, Geometry, Kind

#: The camera's clock as the SDK returns it, unwrapped.
CLOCK = ClockInfo("azure", 1e6)
#: Pixel formats by the SDK's numbers.
_NAMES: Mapping[int, str] = {**dict(enumerate(FORMATS)), 4: "DEPTH16", 5: "IR16"}


@dataclass(frozen=True, slots=True)
class Role:
    """Head, name and kind of a stream, and the SDK's function that has its image of a capture."""

    sensor: str
    stream: str
    kind: Kind
    function: str


DEPTH = Role("depth", "depth", Kind.DEPTH, "k4a_capture_get_depth_image")
#: With the camera's own light, infra-red is the amplitude of its modulation (active brightness).
AMPLITUDE = Role("depth", "amplitude", Kind.AMPLITUDE, "k4a_capture_get_ir_image")
PASSIVE = Role("depth", "ir", Kind.IR, "k4a_capture_get_ir_image")
COLOR = Role("color", "color", Kind.COLOR, "k4a_capture_get_color_image")

#: Frame encoding by kind.
ENCODINGS: Mapping[Kind, str] = {
    Kind.DEPTH: "16UC1",
    Kind.AMPLITUDE: "mono16",
    Kind.IR: "mono16",
    Kind.COLOR: "bgr8",
}


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One image, copied: the SDK waits for its own when streams are stopped.

    Attributes:
        role: its stream.
        format: its pixel format.
        width, height: size [px].
        content: its bytes.
        time_us: device's time of the middle of the exposure.
        exposure_s: NaN if unknown.
        temperature_c: of the depth sensor.
    """

    role: Role
    format: str
    width: int
    height: int
    content: bytes
    time_us: int
    exposure_s: float
    temperature_c: float


def pictures(sdk: Any, capture: ctypes.c_void_p, roles: tuple[Role, ...]) -> Iterator[Picture]:
    """The images of some streams in a capture, which may lack any of them."""
    temperature = float(sdk.k4a_capture_get_temperature_c(capture))
    for role in roles:
        image = getattr(sdk, role.function)(capture)
        if not image:
            continue
        try:
            yield Picture(
                role=role,
                format=_NAMES.get(sdk.k4a_image_get_format(image), "unknown"),
                width=sdk.k4a_image_get_width_pixels(image),
                height=sdk.k4a_image_get_height_pixels(image),
                content=ctypes.string_at(sdk.k4a_image_get_buffer(image), sdk.k4a_image_get_size(image)),
                time_us=sdk.k4a_image_get_device_timestamp_usec(image),
                exposure_s=sdk.k4a_image_get_exposure_usec(image) * 1e-6 or math.nan,
                temperature_c=temperature,
            )
        finally:
            sdk.k4a_image_release(image)


def frame(picture: Picture, camera: Camera, number: int, mode: str) -> Frame:
    """Frame of a picture, with device ticks; host times are set by the caller.

    Args:
        picture: the image.
        camera: of its head; colours must have its size.
        number: of the exposure.
        mode: of the depth sensor.

    Raises:
        ValueError: too few or too many bytes, or another format than the stream's.
    """
    role, is_depth = picture.role, picture.role.kind == Kind.DEPTH
    return Frame(
        sensor=role.sensor,
        stream=role.stream,
        kind=role.kind,
        data=color(picture.format, picture.content, camera) if role.kind == Kind.COLOR else _words(picture),
        encoding=ENCODINGS[role.kind],
        t_host_ns=0,
        t_arrival_ns=0,
        seq=number,
        scale=0.001 if is_depth else 1.0,
        # src/dewrapper asks the depth engine for Z_DEPTH and takes the time `center_of_exposure`.
        geometry=Geometry.Z if is_depth else Geometry.NONE,
        invalid=0.0 if is_depth else None,
        t_device_ticks=picture.time_us,
        tick_hz=CLOCK.tick_hz,
        clock_domain=CLOCK.domain,
        exposure_s=picture.exposure_s,
        temperature_c=picture.temperature_c,
        modulation="" if role.kind == Kind.COLOR else mode,
        calib_id=camera.calib_id,
    )


def _words(picture: Picture) -> Any:
    size = picture.width, picture.height
    if picture.format not in ("DEPTH16", "IR16") or min(size) < 1 or len(picture.content) != 2 * size[0] * size[1]:
        raise ValueError(f"{size[0]} × {size[1]} pixels of {picture.format} do not have {len(picture.content)} bytes")
    return np.frombuffer(picture.content, "<u2").reshape(picture.height, picture.width)
