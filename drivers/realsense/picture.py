"""Video frames of librealsense, and their conversion to frames."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.contract.capabilities import ClockInfo
from drivers.contract.frame import Frame, Kind, Reference
from drivers.encoding.parsing import unpadded
from drivers.realsense.streams import Role, StreamError

#: Frame encodings by kind and pixel format.
FORMATS: Mapping[Kind, Mapping[str, str]] = {
    Kind.DEPTH: {"z16": "16UC1"},
    Kind.IR: {"y8": "mono8", "y16": "mono16"},
    Kind.CONFIDENCE: {"raw8": "mono8", "y8": "mono8"},
    Kind.COLOR: {"rgb8": "rgb8", "bgr8": "bgr8", "y8": "mono8", "y16": "mono16"},
}
#: librealsense gives milliseconds with three decimals, from a 32-bit counter of microseconds. Larger timestamps, from
#: the host's clock, are not changed by the unwrapping.
CLOCK = ClockInfo("realsense", 1e6, 32)
#: Domain of timestamps, unless the kernel withholds the images' metadata.
HARDWARE = "hardware clock"


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One video frame.

    Attributes:
        format: name of its pixel format.
        width, height, stride: size [px] and bytes per row.
        data: its bytes.
        number: of the frame.
        time_ms: timestamp on the clock of `domain`.
        domain: name of the clock: `hardware clock`, `system time` or `global time`.
        depth_unit_m: length of one digit of depth [m].
        exposure, gain: from the metadata; NaN without.
    """

    format: str
    width: int
    height: int
    stride: int
    data: NDArray[np.uint8]
    number: int
    time_ms: float
    domain: str
    depth_unit_m: float
    exposure: float
    gain: float

    @property
    def ticks(self) -> int:
        """Timestamp in ticks of `CLOCK`; 0 if invalid."""
        return round(self.time_ms * 1000) if math.isfinite(self.time_ms) else 0


def from_frame(rs: Any, frame: Any) -> Picture:
    """Picture of an `rs.video_frame`; pixels are not copied."""
    video = frame.as_video_frame()
    depth = frame.as_depth_frame()
    metadata = rs.frame_metadata_value
    return Picture(
        format=frame.get_profile().format().name,
        width=video.get_width(),
        height=video.get_height(),
        stride=video.get_stride_in_bytes(),
        data=np.asarray(frame.get_data()).view(np.uint8).ravel(),
        number=frame.get_frame_number(),
        time_ms=frame.get_timestamp(),
        domain=frame.get_frame_timestamp_domain().name.replace("_", " "),
        depth_unit_m=depth.get_units() if depth else 1.0,
        exposure=_metadata(frame, metadata.actual_exposure),
        gain=_metadata(frame, metadata.gain_level),
    )


def frame(picture: Picture, role: Role, calib_id: str) -> Frame:
    """Frame of a picture, with device ticks; host times are set by the caller.

    Raises:
        StreamError: a format that does not fit the stream.
        CodecError: too few bytes.
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
        t_device_ticks=picture.ticks,
        tick_hz=CLOCK.tick_hz,
        clock_domain=CLOCK.domain,
        t_reference=Reference.END,
        exposure_s=picture.exposure * role.exposure_unit_s,
        gain=picture.gain,
        calib_id=calib_id,
    )


def pixels(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    """Encoding and a copy of the pixels.

    Raises:
        StreamError: as `frame`.
    """
    if picture.format not in FORMATS[kind]:
        raise StreamError(f"{kind} must be one of {', '.join(sorted(FORMATS[kind]))}, not {picture.format}")
    encoding = FORMATS[kind][picture.format]
    return encoding, unpadded(picture.data, encoding, picture.width, picture.height, picture.stride)


def _metadata(frame: Any, key: Any) -> float:
    return float(frame.get_frame_metadata(key)) if frame.supports_frame_metadata(key) else math.nan
