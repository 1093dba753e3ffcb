"""`--skip`: shots that a calibration leaves out."""

import argparse
from collections.abc import Iterable, Iterator, Set
from pathlib import Path

from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.calibration.shots.shots import Shot
from abs_service.commands.calibrate.inputs import live
from abs_service.commands.parts.options import OptionError


def add_argument(parser: argparse.ArgumentParser) -> None:
    """Adds `--skip`."""
    parser.add_argument(
        "--skip", metavar="SHOTS", type=numbers, default=frozenset(), help="shots to leave out, such as 3,7-9"
    )


def numbers(text: str) -> frozenset[int]:
    """Numbers of shots in a list of numbers and ranges, such as `3,7-9`.

    Raises:
        ArgumentTypeError: the text is something else.
    """
    found: set[int] = set()
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not (first.isdecimal() and (last.isdecimal() or not dash)) or (dash and int(last) < int(first)):
            raise argparse.ArgumentTypeError(f"{text!r} must be numbers and ranges of shots, such as 3,7-9")
        found |= set(range(int(first), int(last or first) + 1))
    return frozenset(found)


def text(skipped: Set[int]) -> str:
    """Option for these shots, as on a command line."""
    return ",".join(map(str, sorted(skipped)))


def kept(shots: Iterable[Shot], skipped: Set[int], source: Path | None) -> Iterator[Shot]:
    """Shots without those to leave out.

    Raises:
        OptionError: one of them does not exist, or the shots are of running devices.
    """
    if skipped and live.is_live(source):
        raise OptionError(f"--skip {text(skipped)}: shots of running devices have no numbers that last")
    seen = []
    for shot in shots:
        seen.append(shot.number)
        if shot.number not in skipped:
            yield shot
    if unknown := sorted(skipped - {*seen}):
        there = f"they are numbered from {min(seen)} to {max(seen)}" if seen else "there are none"
        raise OptionError(f"--skip {text(skipped)}: there is no shot {unknown[0]}; {there}")


def kept_of(seen: BoardObservations, skipped: Set[int]) -> BoardObservations:
    """Saved detections without those of the shots to leave out.

    Raises:
        OptionError: one of them does not exist.
    """
    numbers = sorted({view.shot for view in (*seen.corners, *seen.planes)})
    return seen.of_shots([shot.number for shot in kept([Shot(number, {}) for number in numbers], skipped, None)])
