"""Depth sequences from recordings, image folders and live devices, one per exposure setting."""

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots.frame_averaging import FrameAverager
from abs_service.calibration.shots.shots import SensorShot
from calib.camera import Camera
from drivers.contract.device import Device, DeviceState, Sink
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.opening import open_device
from drivers.replay import Recording

#: Timeouts of a live device for the first frame and between frames [s].
PATIENCE_S = 20.0


class SequenceError(Exception):
    """Source without a usable sequence; names the reason."""


@dataclass(frozen=True, slots=True, eq=False)
class Sequence:
    """Frames of one depth sensor with one exposure setting.

    Attributes:
        name: of the source, for display.
        sensor: name of the sensor.
        camera: its camera.
        lengths: measurements (n, height, width) [m], z or radial; NaN without return.
        amplitude: (n, height, width); NaN without.
        reported_sigma: mean σ that the sensor reports (height, width) [m]; NaN without.
        radial: True if the lengths are radial.
        digit: resolution of the lengths [m]; 0 if they are not integers.
        exposure: setting, for display; "" if unknown.
        sensor_shots: mean images of this and other sensors, by sensor, for board detection.
        cameras: of all sensors, by name.
    """

    name: str
    sensor: str
    camera: Camera
    lengths: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    reported_sigma: NDArray[np.float32]
    radial: bool
    digit: float
    exposure: str
    sensor_shots: Mapping[str, SensorShot]
    cameras: Mapping[str, Camera]

    @property
    def along(self) -> NDArray[np.float64]:
        """Radial distance per unit of the lengths (height, width)."""
        return np.ones(self.lengths.shape[1:]) if self.radial else 1 / self.camera.rays()[..., 2]


def with_cameras(sequence: Sequence, cameras: Mapping[str, Camera]) -> Sequence:
    """Sequence with replaced cameras of some sensors; unknown sensors are ignored.

    Raises:
        SequenceError: the depth sensor's new camera has another image size.
    """
    known = {name: cameras.get(name, camera) for name, camera in sequence.cameras.items()}
    camera = known[sequence.sensor]
    if (camera.height, camera.width) != sequence.lengths.shape[1:]:
        height, width = sequence.lengths.shape[1:]
        raise SequenceError(
            f"{sequence.name}: {sequence.sensor} has images of {width} × {height} pixels, but was calibrated with "
            f"{camera.width} × {camera.height}"
        )
    return replace(sequence, camera=camera, cameras=known)


def _ignore() -> None: ...


def of_recording(path: Path, sensor: str, maximum: int, advance: Callable[[], None] = _ignore) -> list[Sequence]:
    """Sequences of one sensor in a recording of abs-service.

    Args:
        path: of the file.
        sensor: name; "" for the only depth sensor.
        maximum: maximum number of frames; the first ones are read.
        advance: called with each depth image that is read.

    Raises:
        SequenceError: unknown sensor, or no name given and not exactly one depth sensor.
        RecordingError: damaged file, or not a recording.
    """
    recording = Recording(path)
    return of_frames(path.name, recording.images(), recording.cameras, sensor, maximum, advance)


def of_device(
    uri: str, sensor: str, maximum: int, clock: Callable[[], int], advance: Callable[[], None] = _ignore
) -> list[Sequence]:
    """Sequences of one sensor of a live device; arguments and errors as in `of_recording`.

    Raises:
        DeviceError: the device cannot be opened.
        SequenceError: the device does not stream.
    """
    device = open_device(uri, clock)
    try:
        collected = _Collected(maximum * max(1, len(device.capabilities.streams)), advance)
        device.start(collected)
        collected.wait()
        device.stop()
    finally:
        device.close()
    if not collected.frames:
        raise SequenceError(f"{uri}: no frame came within {PATIENCE_S:g} s: {collected.reason or 'it gave no reason'}")
    return of_frames(_short(device), collected.frames, device.cameras, sensor, maximum)


def of_frames(
    name: str, frames: Iterable[Frame], cameras: Mapping[str, Camera], sensor: str, maximum: int,
    advance: Callable[[], None] = _ignore,
) -> list[Sequence]:  # fmt: skip
    """Groups frames into sequences by exposure setting; arguments and errors as in `of_recording`."""
    gathered: dict[str, _Gathered] = {}
    others = FrameAverager()
    chosen = sensor
    for frame in frames:
        if frame.kind is Kind.DEPTH and not chosen:
            chosen = frame.sensor
        if frame.kind is Kind.DEPTH and not sensor and frame.sensor != chosen:
            raise SequenceError(f"{name}: there are several depth sensors, {chosen} and {frame.sensor}; choose one")
        if frame.sensor == chosen or not chosen:
            gathered.setdefault(_setting(frame), _Gathered()).add(frame)
            if frame.kind is Kind.DEPTH:
                advance()
        else:
            others.add(frame)
        if sum(len(one.depth) for one in gathered.values()) > maximum:
            break
    gathered = {setting: one for setting, one in gathered.items() if one.depth}
    if not gathered:
        raise SequenceError(f"{name}: there is no depth image" + (f" of a sensor {sensor!r}" if sensor else ""))
    if chosen not in cameras:
        raise SequenceError(f"{name}: nothing says which camera sensor {chosen!r} has")
    seen = others.sensor_shots()
    return [one.sequence(name, setting, cameras, seen, maximum) for setting, one in gathered.items()]


@dataclass(eq=False)
class _Gathered:
    """Frames of one exposure setting, by sequence number."""

    depth: dict[tuple[int, int], Frame] = field(default_factory=dict)
    amplitude: dict[tuple[int, int], Frame] = field(default_factory=dict)
    reported_sigma: dict[tuple[int, int], Frame] = field(default_factory=dict)
    sensor_shots: FrameAverager = field(default_factory=FrameAverager)

    def add(self, frame: Frame) -> None:
        """Adds a frame of any kind."""
        places = {Kind.DEPTH: self.depth, Kind.AMPLITUDE: self.amplitude, Kind.DEVIATION: self.reported_sigma}
        places.get(frame.kind, {})[frame.epoch, frame.seq] = frame
        self.sensor_shots.add(frame)

    def sequence(
        self, name: str, setting: str, cameras: Mapping[str, Camera], others: Mapping[str, SensorShot], maximum: int
    ) -> Sequence:
        """Sequence of the first depth images; without amplitudes if one of them has none."""
        numbers = list(self.depth)[:maximum]
        first = self.depth[numbers[0]]
        lengths = np.stack([self.depth[number].si() for number in numbers])
        nothing = np.full((1, *lengths.shape[1:]), np.nan, np.float32)
        amplitude = self._images(self.amplitude, numbers, np.broadcast_to(nothing, lengths.shape))
        reported_sigma = self._images(self.reported_sigma, numbers, nothing)
        return Sequence(
            f"{name} ({setting})" if setting else name,
            first.sensor,
            cameras[first.sensor],
            lengths,
            amplitude,
            reported_sigma.mean(axis=0),
            first.geometry == Geometry.RADIAL,
            first.scale if first.data.dtype.kind in "ui" else 0.0,
            setting,
            {**others, **self.sensor_shots.sensor_shots()},
            cameras,
        )

    @staticmethod
    def _images(
        frames: Mapping[tuple[int, int], Frame], numbers: list[tuple[int, int]], otherwise: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        return np.stack([frames[n].si() for n in numbers]) if all(n in frames for n in numbers) else otherwise


class _Collected(Sink):
    """Frame sink with a maximum number of frames."""

    def __init__(self, maximum: int, advance: Callable[[], None]) -> None:
        self.frames: list[Frame] = []
        self._advance = advance
        self.reason = ""
        self._maximum = maximum
        self._more = threading.Semaphore(0)

    def on_frame(self, frame: Frame) -> None:
        self.frames.append(frame)
        if frame.kind is Kind.DEPTH:
            self._advance()
        self._more.release()

    def on_state(self, state: DeviceState, reason: str) -> None:
        self.reason = reason

    def wait(self) -> None:
        """Waits for the maximum number of frames, or a timeout."""
        for _ in range(self._maximum):
            if not self._more.acquire(timeout=PATIENCE_S):
                return


def _setting(frame: Frame) -> str:
    """Exposure settings within which amplitudes are comparable."""
    exposure = f"{frame.exposure_s * 1e3:.3g} ms" if np.isfinite(frame.exposure_s) else ""
    gain = f"gain {frame.gain:.3g}" if np.isfinite(frame.gain) else ""
    return ", ".join(part for part in (exposure, gain, frame.modulation) if part)


def _short(device: Device) -> str:
    uri = device.info.uri
    return uri if len(uri) <= 60 else f"{uri[:57]}…"
