"""Streams of an OAK, by their names in recordings."""

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.contract.frame import Kind


@dataclass(frozen=True, slots=True)
class Role:
    """Head, name and kind of a stream."""

    sensor: str
    stream: str
    kind: Kind

    @property
    def key(self) -> tuple[str, str]:
        """(sensor, stream)."""
        return self.sensor, self.stream


#: By their name in recordings. Stereo depth and the left infra-red image are both in the left camera's rectified view,
#: so they are one head.
ROLES: Mapping[str, Role] = {
    "tof_depth": Role("tof", "depth", Kind.DEPTH),
    "tof_amplitude": Role("tof", "amplitude", Kind.AMPLITUDE),
    "tof_intensity": Role("tof", "intensity", Kind.INTENSITY),
    "tof_confidence": Role("tof", "confidence", Kind.CONFIDENCE),
    "depth": Role("depth", "depth", Kind.DEPTH),
    "confidence": Role("depth", "confidence", Kind.CONFIDENCE),
    "left": Role("depth", "ir", Kind.IR),
    "right": Role("right", "ir", Kind.IR),
    "color": Role("color", "color", Kind.COLOR),
}

#: Candidates for the head that defines the rig's frame, in order of preference.
REFERENCES = ("tof", "depth", "right", "color")
