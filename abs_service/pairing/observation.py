"""Observations: one decoded image per sensor, from a frame set."""

from dataclasses import dataclass

from abs_service.pairing.image_decoders import ObservationError, decoder, kinds
from abs_service.pairing.images import Image
from calib.camera import Camera
from calib.rig import Rig
from drivers.contract.frame import Frame, FrameSet

__all__ = ["Observation", "ObservationError", "Observer", "Source"]


@dataclass(frozen=True, slots=True)
class Source:
    """Exposure of an image of the observation: number, time and standard deviation of the time [ns]."""

    seq: int
    t_host_ns: int
    t_sigma_ns: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """All measurements of a rig at one moment.

    Attributes:
        seq: number of the frame set.
        t_host_ns: the moment, CLOCK_MONOTONIC [ns].
        images: image of every sensor that contributed.
        sources: the exposure each image comes from.
        missing: sensors without an image.
    """

    seq: int
    t_host_ns: int
    images: dict[str, Image]
    sources: dict[str, Source]
    missing: tuple[str, ...]


class Observer:
    """Converts frame sets of one rig to observations; holds constant tables per sensor."""

    def __init__(self, rig: Rig):
        self._rig = rig
        self._decoders = {name: decoder(sensor) for name, sensor in rig.sensors.items()}

    def observe(self, frames: FrameSet) -> Observation:
        """Converts a frame set.

        Raises:
            ObservationError: an image has another size than the sensor's camera, or holds something else.
        """
        images: dict[str, Image] = {}
        sources: dict[str, Source] = {}
        for name, sensor in self._rig.sensors.items():
            members = {frame.kind: frame for frame in frames.frames.values() if frame.sensor == sensor.head}
            for frame in members.values():
                _check_size(frame, sensor.camera)
            needed = kinds(sensor.noise)
            if members.keys() >= set(needed):
                images[name] = self._decoders[name].decode(members)
                sources[name] = _source(members[needed[0]])
        missing = tuple(name for name in self._rig.sensors if name not in images)
        return Observation(frames.seq, frames.stamp_ns, images, sources, missing)


def _source(frame: Frame) -> Source:
    return Source(frame.seq, frame.t_host_ns, frame.t_sigma_ns)


def _check_size(frame: Frame, camera: Camera) -> None:
    height, width = frame.data.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise ObservationError(
            f"{frame.sensor}/{frame.stream} is {width} × {height} pixels, but the camera model of "
            f"sensors.{frame.sensor} is for {camera.width} × {camera.height}"
        )
