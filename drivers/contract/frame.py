"""Frames: images with the metadata needed to interpret them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


class Kind(StrEnum):
    """Quantity that an image holds; a `DEVIATION` is the sensor's own σ of the depth image of the same exposure."""

    DEPTH = "depth"
    AMPLITUDE = "amplitude"
    INTENSITY = "intensity"
    CONFIDENCE = "confidence"
    IR = "ir"
    COLOR = "color"
    BAYER = "bayer"
    BINARY = "binary"
    DEVIATION = "deviation"


class Geometry(StrEnum):
    """Type of distance in a depth image; `NONE` for other images."""

    NONE = "none"
    Z = "z"
    RADIAL = "radial"


class Reference(StrEnum):
    """Point of the exposure that the host time refers to."""

    START = "start"
    MIDDLE = "middle"
    END = "end"


class FrameError(ValueError):
    """An inconsistent frame."""


#: Exposures from the reference to the middle.
_TO_MIDDLE: Mapping[Reference, float] = {Reference.START: 0.5, Reference.MIDDLE: 0.0, Reference.END: -0.5}
#: Longest exposure that is believed [s].
_MAX_EXPOSURE_S = 10.0

#: Default unit by kind; all other kinds are in device-specific digital numbers.
_UNITS: Mapping[Kind, str] = {Kind.DEPTH: "m", Kind.DEVIATION: "m", Kind.BINARY: "1"}

#: Pixel encodings as in foxglove.RawImage, with the array they hold: (dtype, channels).
ENCODINGS: Mapping[str, tuple[np.dtype, int]] = {
    "mono8": (np.dtype("u1"), 1),
    "mono16": (np.dtype("<u2"), 1),
    "16UC1": (np.dtype("<u2"), 1),
    "32FC1": (np.dtype("<f4"), 1),
    "rgb8": (np.dtype("u1"), 3),
    "bgr8": (np.dtype("u1"), 3),
    "bayer_rggb8": (np.dtype("u1"), 1),
    "bayer_bggr8": (np.dtype("u1"), 1),
    "bayer_gbrg8": (np.dtype("u1"), 1),
    "bayer_grbg8": (np.dtype("u1"), 1),
}


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One image of one stream, immutable.

    Attributes:
        sensor: name of the optical head in the rig; all streams of a sensor share one camera model.
        stream: name of the stream, unique within its sensor.
        kind: quantity that the image holds.
        data: pixels as measured, read-only, shape (height, width) or (height, width, 3), dtype given by `encoding`.
        encoding: one of `ENCODINGS`.
        t_host_ns: host time of the exposure on CLOCK_MONOTONIC [ns].
        t_arrival_ns: host time at which the device's frame arrived, on the same clock [ns].
        seq: counts the device's exposures; depth and amplitude of one exposure share it; gaps are losses.
        epoch: incremented by each reconnect or clock step; seq and ticks restart.
        scale: value, in `unit`, of one step of `data`.
        unit: unit of `data` times `scale`: "m" for lengths, "1" for binary values, "dn" for device-specific digital
            numbers; the default depends on the kind.
        geometry: type of distance in a depth image.
        invalid: the value of `data` that means "no return"; NaN always does; None if every value is a measurement.
        t_device_ticks, tick_hz: the device's timestamp and its rate; rate 0 if the device has no clock.
        clock_domain: name of the clock of the ticks.
        t_sigma_ns: standard deviation of `t_host_ns` [ns].
        t_reference: point of the exposure that the timestamps refer to; frames are paired by its middle.
        exposure_s, gain, temperature_c: settings during the exposure; NaN if unknown.
        modulation: modulation or range profile of a time-of-flight sensor, "" if none.
        calib_id: hash of the device's camera model, "" if unknown.
        undistorted: True if the device removed the lens distortion.
        aligned_to: sensor to whose view the device registered the image, "" if it is in the sensor's own view.
        filters: filters applied by the device, in order.
        incomplete: True if a part of the image was lost on the way; its pixels have no return.
        saturated: flag of the device.
        host_clock: which host's clock the host times are of, see `drivers.contract.host_clock`; "" for this one's.
        t_received_ns: time at which this process received the frame from another one, on this host's CLOCK_MONOTONIC
            [ns]; None for a device of this process.
    """

    sensor: str
    stream: str
    kind: Kind
    data: NDArray[np.generic]
    encoding: str
    t_host_ns: int
    t_arrival_ns: int
    seq: int
    epoch: int = 0
    scale: float = 1.0
    unit: str = ""
    geometry: Geometry = Geometry.NONE
    invalid: float | None = None
    t_device_ticks: int = 0
    tick_hz: float = 0.0
    clock_domain: str = "host"
    t_sigma_ns: int = 0
    t_reference: Reference = Reference.MIDDLE
    exposure_s: float = float("nan")
    gain: float = float("nan")
    temperature_c: float = float("nan")
    modulation: str = ""
    calib_id: str = ""
    undistorted: bool = False
    aligned_to: str = ""
    filters: tuple[str, ...] = ()
    incomplete: bool = False
    saturated: bool = False
    host_clock: str = ""
    t_received_ns: int | None = None

    def __post_init__(self) -> None:
        if self.encoding not in ENCODINGS:
            raise FrameError(f"{self.sensor}/{self.stream}: encoding {self.encoding!r} is none of {sorted(ENCODINGS)}")
        dtype, channels = ENCODINGS[self.encoding]
        ndim = 2 if channels == 1 else 3
        if self.data.dtype != dtype or self.data.ndim != ndim or (ndim == 3 and self.data.shape[2] != channels):
            raise FrameError(
                f"{self.sensor}/{self.stream}: {self.encoding} needs {dtype} with {channels} channel(s), "
                f"got {self.data.dtype} of shape {self.data.shape}"
            )
        if self.kind == Kind.DEPTH and self.geometry == Geometry.NONE:
            raise FrameError(f"{self.sensor}/{self.stream}: a depth frame must declare its geometry, z or radial")
        if not self.unit:
            object.__setattr__(self, "unit", _UNITS.get(self.kind, "dn"))
        if self.data.flags.writeable:
            view = self.data.view()
            view.setflags(write=False)
            object.__setattr__(self, "data", view)

    @property
    def key(self) -> tuple[str, str]:
        """(sensor, stream), the identity of the frame's stream."""
        return self.sensor, self.stream

    def at_middle(self) -> "Frame":
        """The frame with the times of the middle of its exposure; unchanged if the exposure is unknown."""
        if self.t_reference is Reference.MIDDLE or not 0 <= self.exposure_s <= _MAX_EXPOSURE_S:
            return self
        after_s = _TO_MIDDLE[self.t_reference] * self.exposure_s
        return replace(
            self,
            t_host_ns=self.t_host_ns + round(after_s * 1e9),
            t_device_ticks=self.t_device_ticks + round(after_s * self.tick_hz),
            t_reference=Reference.MIDDLE,
        )

    def si(self, rows: slice = slice(None), columns: slice = slice(None)) -> NDArray[np.float32]:
        """The image, or some rows and columns of it, in `unit` as float32, NaN where there is no return."""
        data = self.data[rows, columns].copy()  # one memory layout, for which the kernel is compiled
        values = np.empty(data.shape, np.float32)
        invalid = np.float32(np.nan if self.invalid is None else self.invalid)
        _convert(data.reshape(-1), np.float32(self.scale), invalid, values.reshape(-1))
        return values


@kernel
def _convert(data: NDArray[Any], scale: np.float32, invalid: np.float32, values: NDArray[np.float32]) -> None:
    """Data (n,) times scale, NaN where it is invalid; ten times as fast as one operation after the other."""
    for i in range(data.size):
        value = np.float32(data[i])
        values[i] = np.float32(np.nan) if value == invalid else value * scale


@dataclass(frozen=True, slots=True, eq=False)
class FrameSet:
    """Synchronised frames of several streams.

    Attributes:
        seq: sequence number of the set.
        stamp_ns: host time of the reference stream's frame, CLOCK_MONOTONIC [ns].
        frames: the members by (sensor, stream).
        missing: expected streams without a frame within the tolerance.
        spread_ns: maximum difference between a member's timestamp and `stamp_ns` [ns].
        host_clock: which host's clock `stamp_ns` is of, see `Frame`.
    """

    seq: int
    stamp_ns: int
    frames: Mapping[tuple[str, str], Frame]
    missing: tuple[tuple[str, str], ...] = field(default=())
    spread_ns: int = 0
    host_clock: str = ""
