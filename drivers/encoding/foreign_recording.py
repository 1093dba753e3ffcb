"""What other programs recorded, as frames: the form in which every format of theirs is read."""

from collections.abc import Iterator, Mapping
from typing import Protocol

from calib.camera import Camera
from drivers.contract.frame import Frame


class ForeignRecordingError(Exception):
    """A recording of another program that cannot be read; names the file and what is wrong with it."""


class ForeignRecording(Protocol):
    """Frames of a few sensors, with what took them. Their host times count from wherever the recording's do."""

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """The camera of every sensor, by sensor name."""
        ...

    @property
    def total(self) -> int | None:
        """How many frames there are; None if only reading them tells."""
        ...

    def frames(self) -> Iterator[Frame]:
        """Every frame in the order of its time, read when it is asked for.

        Raises:
            ForeignRecordingError: the recording is damaged.
        """
        ...
