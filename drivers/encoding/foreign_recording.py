"""Interface of recordings made by other programs."""

from collections.abc import Iterator, Mapping
from typing import Protocol

from calib.camera import Camera
from drivers.contract.frame import Frame


class ForeignRecordingError(Exception):
    """An unreadable recording of another program; names the file and the problem."""


class ForeignRecording(Protocol):
    """Frames and cameras of a recording. Host times have the recording's own origin."""

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """The camera of every sensor, by sensor name."""
        ...

    @property
    def total(self) -> int | None:
        """Number of frames; None if it is only known after reading all of them."""
        ...

    def frames(self) -> Iterator[Frame]:
        """All frames in order of time, read lazily.

        Raises:
            ForeignRecordingError: the recording is damaged.
        """
        ...
