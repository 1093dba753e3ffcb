"""What a device delivers: one image with everything needed to interpret it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class Kind(StrEnum):
    """What the numbers of an image mean; a `DEVIATION` is what the sensor says of the depth beside it, as σ."""

    DEPTH = "depth"
    AMPLITUDE = "amplitude"
    INTENSITY = "intensity"
    CONFIDENCE = "confidence"
    IR = "ir"
    COLOR = "color"
    BAYER = "bayer"
    PHASE = "phase"
    DISPARITY = "disparity"
    BINARY = "binary"
    DEVIATION = "deviation"


class Geometry(StrEnum):
    """Which length a depth image holds; `NONE` for images that hold no length."""

    NONE = "none"
    Z = "z"
    RADIAL = "radial"


class Reference(StrEnum):
    """Which moment of the exposure the host time refers to."""

    START = "start"
    MIDDLE = "middle"
    END = "end"


class FrameError(ValueError):
    """A frame that contradicts itself."""


#: The unit of an image that declares none, by its kind; the others hold numbers that only the device understands.
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
        kind: what the numbers mean.
        data: pixels as measured, read-only, shape (height, width) or (height, width, 3), dtype given by `encoding`.
        encoding: one of `ENCODINGS`.
        t_host_ns: host time of the exposure on CLOCK_MONOTONIC [ns].
        t_arrival_ns: when the host had the frame, CLOCK_MONOTONIC [ns].
        seq: counts the device's exposures; depth and amplitude of one exposure share it; gaps are losses.
        epoch: grows by one with each reconnect or clock step; seq and ticks start anew.
        scale: value, in `unit`, of one step of `data`.
        unit: what `data` times `scale` is measured in: "m" for lengths, "1" for yes (1) and no (0), "dn" for numbers
            that only the device knows the meaning of; by default what fits the kind.
        geometry: which length a depth image holds.
        invalid: the value of `data` that means "no return"; NaN always does; None if every value is a measurement.
        t_device_ticks, tick_hz: the device's own stamp and its rate; rate 0 if the device has no clock.
        clock_domain: name of the clock that made the ticks.
        t_sigma_ns: standard deviation of `t_host_ns` [ns].
        t_reference: moment of the exposure that the stamps refer to.
        exposure_s, gain, temperature_c: settings during the exposure; NaN if unknown.
        modulation: modulation or range profile of a time-of-flight sensor, "" if none.
        calib_id: hash of the camera model the device had in mind, "" if unknown.
        undistorted: whether the device removed the lens distortion.
        aligned_to: sensor into whose view the device warped the image, "" if it is the sensor's own.
        filters: names of the filters that the device applied, in order.
        incomplete, saturated: flags of the device.
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

    def si(self) -> NDArray[np.float32]:
        """The image in `unit` as float32, NaN where there is no return."""
        values = self.data.astype(np.float32)
        values *= np.float32(self.scale)
        if self.invalid is not None:
            values[self.data == self.invalid] = np.nan
        return values


@dataclass(frozen=True, slots=True, eq=False)
class FrameSet:
    """Frames of several streams that show one moment.

    Attributes:
        seq: counts the sets that a synchroniser formed.
        stamp_ns: host time of the reference stream's frame, CLOCK_MONOTONIC [ns].
        frames: the members by (sensor, stream).
        missing: streams that were expected and have no frame within the tolerance.
        spread_ns: largest difference between a member's stamp and `stamp_ns` [ns].
    """

    seq: int
    stamp_ns: int
    frames: Mapping[tuple[str, str], Frame]
    missing: tuple[tuple[str, str], ...] = field(default=())
    spread_ns: int = 0
