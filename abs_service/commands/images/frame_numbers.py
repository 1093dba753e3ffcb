"""Numbers of exposures as they are typed: `200:319`, `0:100:5`, `7,9,20:`."""

import argparse
import re
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.image_folder.listing import ImageFile, ImageFolderError

_RANGE = re.compile(r"(\d+)|(\d*):(\d*)(?::([1-9]\d*))?")


@dataclass(frozen=True)
class FrameNumbers:
    """A choice of exposures.

    Attributes:
        text: as it was typed.
        ranges: first, last (included; None for no end) and step of each range.
    """

    text: str
    ranges: tuple[tuple[int, int | None, int], ...]

    def __contains__(self, number: int) -> bool:
        return any(
            number >= first and (last is None or number <= last) and (number - first) % step == 0
            for first, last, step in self.ranges
        )

    def of(self, files: Sequence[ImageFile]) -> list[ImageFile]:
        """The chosen images.

        Raises:
            ImageFolderError: there is none.
        """
        chosen = [file for file in files if file.seq in self]
        if not chosen and all(last is not None and last < first for first, last, _ in self.ranges):
            raise ImageFolderError(f"--frames {self.text}: the first number is larger than the last one")
        if not chosen:
            numbers = f"{files[0].seq} to {files[-1].seq}"
            raise ImageFolderError(f"--frames {self.text}: no image has such a number; there are {numbers}")
        return chosen


#: All exposures.
ALL = FrameNumbers(":", ((0, None, 1),))


def parse(text: str) -> FrameNumbers:
    """Reads FIRST:LAST or FIRST:LAST:STEP, both ends included and optional, or a number; several with commas.

    Raises:
        argparse.ArgumentTypeError: it is none.
    """
    ranges: list[tuple[int, int | None, int]] = []
    for part in text.split(","):
        match = _RANGE.fullmatch(part.strip())
        if match is None:
            raise argparse.ArgumentTypeError(f"{text!r} must be FIRST:LAST or FIRST:LAST:STEP, such as 200:319")
        single, first, last, step = match.groups()
        if single:
            ranges.append((int(single), int(single), 1))
        else:
            ranges.append((int(first or 0), int(last) if last else None, int(step or 1)))
    return FrameNumbers(text, tuple(ranges))


def nearest(files: Sequence[ImageFile], others: Sequence[ImageFile]) -> list[ImageFile]:
    """Files (of `files`) that are nearest in time to one of the others."""
    chosen = {min(files, key=lambda file: abs(file.t_ns - other.t_ns)) for other in others}
    return sorted(chosen, key=lambda file: file.t_ns)
