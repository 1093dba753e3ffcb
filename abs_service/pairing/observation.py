"""Observations: one decoded image per sensor, of one moment."""

from dataclasses import dataclass

from abs_service.pairing.images import Image


class ObservationError(ValueError):
    """A frame that does not match the rig's configuration."""


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
