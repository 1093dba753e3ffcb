"""From a set of frames to what the tracker compares with: SI values, radial distances, one camera per sensor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.noise.color import GaussianColor
from calib.rig import Rig, Sensor
from drivers.frame import Frame, FrameSet, Geometry, Kind


class ObservationError(ValueError):
    """A frame that does not fit the rig it is said to come from."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthImage:
    """What a depth sensor measured.

    Attributes:
        distance: radial distances (height, width) [m], NaN without return.
        amplitude: amplitudes (height, width) in the sensor's unit; NaN where there is none.
    """

    distance: NDArray[np.float32]
    amplitude: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class ColorImage:
    """What a colour sensor measured: red, green, blue (height, width, 3) in 0…255."""

    rgb: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Source:
    """Which exposure an image of the observation comes from, and how well its time is known [ns]."""

    seq: int
    t_host_ns: int
    t_sigma_ns: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Everything the sensors of a rig say about one moment.

    Attributes:
        seq: number of the frame set.
        t_host_ns: the moment, CLOCK_MONOTONIC [ns].
        images: image of every sensor that contributed.
        sources: the exposure each image comes from.
        missing: sensors that should have contributed and did not.
    """

    seq: int
    t_host_ns: int
    images: dict[str, DepthImage | ColorImage]
    sources: dict[str, Source]
    missing: tuple[str, ...]


class Observer:
    """Makes observations of one rig; keeps per-sensor tables that never change."""

    def __init__(self, rig: Rig):
        self._rig = rig
        self._ray_length = {name: _ray_length(sensor.camera) for name, sensor in rig.sensors.items()}

    def observe(self, frames: FrameSet) -> Observation:
        """Converts a frame set.

        Raises:
            ObservationError: an image has another size than the sensor's camera.
        """
        images: dict[str, DepthImage | ColorImage] = {}
        sources: dict[str, Source] = {}
        for name, sensor in self._rig.sensors.items():
            members = {frame.kind: frame for frame in frames.frames.values() if frame.sensor == name}
            for frame in members.values():
                _check_size(frame, sensor.camera)
            if Kind.DEPTH in members and (Kind.AMPLITUDE in members or not _needs_amplitude(sensor)):
                images[name] = self._depth(members[Kind.DEPTH], members.get(Kind.AMPLITUDE))
                sources[name] = _source(members[Kind.DEPTH])
            elif Kind.COLOR in members:
                images[name] = ColorImage(_rgb(members[Kind.COLOR]))
                sources[name] = _source(members[Kind.COLOR])
        missing = tuple(name for name in self._rig.sensors if name not in images)
        return Observation(frames.seq, frames.stamp_ns, images, sources, missing)

    def _depth(self, depth: Frame, amplitude: Frame | None) -> DepthImage:
        distance = depth.si()
        if depth.geometry == Geometry.Z:
            distance = distance * self._ray_length[depth.sensor]
        values = np.full_like(distance, np.nan) if amplitude is None else amplitude.si()
        return DepthImage(distance, values)


def _ray_length(camera: Camera) -> NDArray[np.float32]:
    """Radial distance per unit of z of every pixel (height, width)."""
    return (1 / camera.rays()[..., 2]).astype(np.float32)


def _source(frame: Frame) -> Source:
    return Source(frame.seq, frame.t_host_ns, frame.t_sigma_ns)


def _needs_amplitude(sensor: Sensor) -> bool:
    return not isinstance(sensor.noise, GaussianColor) and sensor.noise.uses_amplitude


def _rgb(frame: Frame) -> NDArray[np.uint8]:
    pixels = frame.data.view(np.uint8)
    return pixels[..., ::-1] if frame.encoding == "bgr8" else pixels


def _check_size(frame: Frame, camera: Camera) -> None:
    height, width = frame.data.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise ObservationError(
            f"{frame.sensor}/{frame.stream} is {width} × {height} pixels, but the camera model of "
            f"sensors.{frame.sensor} is for {camera.width} × {camera.height}"
        )
