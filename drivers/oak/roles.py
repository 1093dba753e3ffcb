"""What the images of an OAK are here."""

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.contract.frame import Kind


@dataclass(frozen=True, slots=True)
class Role:
    """What images are: head, name of the stream, and kind."""

    sensor: str
    stream: str
    kind: Kind

    @property
    def key(self) -> tuple[str, str]:
        """(sensor, stream)."""
        return self.sensor, self.stream


#: By the name that they have in recordings. Stereo depth is the left camera's rectified view, and so is that camera's
#: infra-red image: one head.
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

#: Heads whose view is the rig's frame, the first that there is.
REFERENCES = ("tof", "depth", "right", "color")
