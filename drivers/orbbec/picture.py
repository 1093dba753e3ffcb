"""Frames from the SDK's images."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.contract.capabilities import ClockInfo
from drivers.contract.frame import ENCODINGS, Frame, Kind, Reference
from drivers.orbbec.streams import FORMATS, Role, StreamError

#: The cameras' clock as the SDK returns it: unwrapped, in microseconds.
CLOCK = ClockInfo("orbbec", 1e6)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One image.

    Attributes:
        format: name of its pixel format.
        width, height: size [px].
        data: its bytes.
        number: of the exposure.
        time_us: device's time.
        depth_unit_m: length of one digit of depth [m].
        gain: from the metadata; NaN without.
    """

    format: str
    width: int
    height: int
    data: NDArray[np.uint8]
    number: int
    time_us: int
    depth_unit_m: float
    gain: float


def from_frame(ob: Any, image: Any, kind: Kind) -> Picture:
    """Picture of an `ob.Frame`; the SDK copies the pixels."""
    video = image.as_video_frame()
    gain = ob.OBFrameMetadataType.GAIN
    return Picture(
        format=image.get_format().name,
        width=video.get_width(),
        height=video.get_height(),
        data=np.asarray(image.get_data()),
        number=image.get_index(),
        time_us=image.get_timestamp_us(),
        depth_unit_m=image.as_depth_frame().get_depth_scale() * 1e-3 if kind == Kind.DEPTH else 1.0,
        gain=float(image.get_metadata_value(gain)) if image.has_metadata(gain) else math.nan,
    )


def frame(picture: Picture, role: Role, calib_id: str, filters: tuple[str, ...]) -> Frame:
    """Frame of a picture, with device ticks; host times are set by the caller.

    Raises:
        StreamError: a format that does not fit the stream, too few or too many bytes, or an impossible unit.
    """
    is_depth = role.kind == Kind.DEPTH
    if is_depth and not 0 < picture.depth_unit_m < math.inf:
        raise StreamError(f"a depth unit of {picture.depth_unit_m} m is none")
    encoding, data = pixels(picture, role.kind)
    return Frame(
        sensor=role.sensor,
        stream=role.stream,
        kind=role.kind,
        data=data,
        encoding=encoding,
        t_host_ns=0,
        t_arrival_ns=0,
        seq=picture.number,
        scale=picture.depth_unit_m if is_depth else 1.0,
        geometry=role.geometry,
        invalid=0.0 if is_depth else None,
        t_device_ticks=picture.time_us,
        tick_hz=CLOCK.tick_hz,
        clock_domain=CLOCK.domain,
        t_reference=Reference.MIDDLE,  # libobsensor/h/Frame.h: "Typically in the mid-exposure"
        gain=picture.gain,
        calib_id=calib_id,
        filters=filters if is_depth else (),
    )


def pixels(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    """Encoding and pixels, (height, width) or (height, width, 3).

    Raises:
        StreamError: as `frame`.
    """
    if picture.format not in FORMATS[kind]:
        raise StreamError(f"{kind} must be one of {', '.join(FORMATS[kind])}, not {picture.format}")
    encoding = FORMATS[kind][picture.format]
    dtype, channels = ENCODINGS[encoding]
    shape = (picture.height, picture.width) + ((channels,) if channels > 1 else ())
    if min(shape) < 1 or picture.data.size != math.prod(shape) * dtype.itemsize:
        size = f"{picture.width} × {picture.height} × {channels}"
        raise StreamError(f"{size} {encoding} do not have {picture.data.size} bytes")
    return encoding, np.ascontiguousarray(picture.data).view(dtype).reshape(shape)
