"""Interface of a recording, as far as a tracker replays it."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol, runtime_checkable

from drivers.contract.frame import Frame


@runtime_checkable
class Replayable(Protocol):
    """Images in the order of their times, as a `Recording` has them."""

    path: Path

    @property
    def streams(self) -> Mapping[str, int]:
        """Number of images by "sensor/stream"."""
        ...

    def frames(self) -> Iterator[Frame]:
        """The images as devices deliver them."""
        ...
