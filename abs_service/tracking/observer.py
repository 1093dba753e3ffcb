"""Observations from frame sets: every sensor's frames are decoded by its kind of measurement."""

from collections.abc import Collection, Iterable

from abs_service.pairing.images import Image
from abs_service.pairing.observation import Observation, Source, check_size
from abs_service.tracker.measurements import measurement
from calib.rig import Rig, Sensor
from drivers.contract.frame import Frame, FrameSet


class Observer:
    """Converts frame sets of one rig to observations; holds constant tables per sensor."""

    def __init__(self, rig: Rig):
        self._rig = rig
        kinds = {name: measurement(sensor.noise) for name, sensor in rig.sensors.items()}
        self._needed = {name: kind.frames for name, kind in kinds.items()}
        self._decoders = {name: kind.decoder(rig.sensors[name]) for name, kind in kinds.items()}

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
                check_size(frame, sensor.camera)
            needed = self._needed[name]
            if members.keys() >= set(needed):
                images[name] = self._decoders[name](members)
                sources[name] = _source(members[needed[0]])
        missing = tuple(name for name in self._rig.sensors if name not in images)
        return Observation(frames.seq, frames.stamp_ns, images, sources, missing)


def _source(frame: Frame) -> Source:
    return Source(frame.seq, frame.t_host_ns, frame.t_sigma_ns)


def streams(sensors: Iterable[Sensor]) -> list[tuple[str, str]]:
    """The (head, stream) of every image that the sensors' noise models require; streams are named after their kind."""
    needed = ((sensor.head, kind.value) for sensor in sensors for kind in measurement(sensor.noise).frames)
    return list(dict.fromkeys(needed))


def missing_streams(sensors: Iterable[Sensor], there: Collection[str]) -> list[str]:
    """Streams of the sensors that a recording lacks, as "sensor/stream"."""
    return [name for head, stream in streams(sensors) if (name := f"{head}/{stream}") not in there]
