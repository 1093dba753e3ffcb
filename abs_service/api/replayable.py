"""Interface of a recording, as far as a tracker replays it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol, runtime_checkable


@runtime_checkable
class Replayable(Protocol):
    """A file with images, as a `Recording` is."""

    path: Path

    @property
    def streams(self) -> Mapping[str, int]:
        """Number of images by "sensor/stream"."""
        ...
