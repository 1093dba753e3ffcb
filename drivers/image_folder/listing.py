"""Image files with their timestamps, by number or from a list."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from pathlib import Path

from calib.files import limited
from drivers.image_folder import times

#: Largest list of images [bytes].
MAX_LIST_BYTES = 1 << 26

#: Latest time of a numbered exposure [s], of the year 2106: what is later is no count of exposures.
_MAX_S = 1 << 32

#: Suffixes of images, and how many files are looked at and patterns are named where none matches.
_SUFFIXES = {".bmp", ".jpeg", ".jpg", ".npy", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"}
_LOOKED_AT, _NAMED = 100_000, 4

#: Suffixes of films.
_VIDEOS = {".avi", ".m4v", ".mkv", ".mov", ".mp4", ".webm"}


class ImageFolderError(Exception):
    """A folder or file that cannot be imported; names it and the problem."""


@dataclass(frozen=True, slots=True)
class ImageFile:
    """One image file and its timestamp.

    Attributes:
        path: of the file.
        seq: number of the exposure.
        t_ns: time of the exposure [ns]; the origin is common to all images of a folder.
    """

    path: Path
    seq: int
    t_ns: int


def last_number(stem: str) -> int | None:
    """Last number in a name; None without any."""
    numbers = re.findall(r"\d+", stem)
    return int(numbers[-1]) if numbers else None


def changing_numbers(stems: Sequence[str]) -> list[tuple[int, ...]]:
    """Numbers in each name, such as a date and a time, without those that all names have in the same place."""
    found = [tuple(map(int, re.findall(r"\d+", stem))) for stem in stems]
    same = {place for place, values in enumerate(zip(*found)) if len({*values}) == 1} if len(found) > 1 else set()
    return [tuple(value for place, value in enumerate(numbers) if place not in same) for numbers in found]


def by_number(folder: Path, pattern: str, rate_hz: float, *, alone: bool = False) -> list[ImageFile]:
    """Files that match a pattern, sorted by the last number in their name, the sequence number.

    Args:
        folder: the folder.
        pattern: glob pattern, such as `depth_*.png`.
        rate_hz: exposures per second; number n was taken n / rate_hz seconds after number 0.
        alone: True if no other images are to be matched by number: files that share a last number, as times of the day
            do, are then sorted by all their numbers and counted from 0.

    Raises:
        ImageFolderError: missing folder, no match, a name without a number, or duplicate numbers.
    """
    if not folder.is_dir():
        raise ImageFolderError(f"{folder}: {'is no folder' if folder.exists() else 'no such folder'}")
    paths = sorted(folder.glob(pattern))
    if not paths:
        raise ImageFolderError(f"{folder}: no file matches {pattern!r}{_instead(folder)}")
    for path in paths:
        if path.suffix.lower() in _VIDEOS:
            command = f"ffmpeg -i {path.name} -fps_mode passthrough -start_number N color_%06d.png"
            raise ImageFolderError(
                f"{path}: is a film; `{command}` makes images of it, where N is the number of the first depth image"
                f"{_instead(folder)}"
            )
        if last_number(path.stem) is None:
            raise ImageFolderError(
                f"{path}: there is no number in its name to tell which exposure it is{_instead(folder)}"
            )
    numbered = {number: path for path in paths if (number := last_number(path.stem)) is not None}
    if len(numbered) < len(paths):
        numbered = dict(enumerate(_by_all_numbers(paths, alone)))
    return [ImageFile(numbered[number], number, round(number * 1e9 / rate_hz)) for number in sorted(numbered)]


def by_name(folder: Path, pattern: str, rate_hz: float) -> list[ImageFile]:
    """Files that match a pattern by the times in all their names, counted from 0; without such times as `by_number`.

    Raises:
        ImageFolderError: as `by_number`, or two names have one time.
    """
    paths = sorted(folder.glob(pattern))
    timed = [(time, path) for path in paths if (time := times.in_name(path.stem)) is not None]
    if not timed or len(timed) < len(paths):
        files = by_number(folder, pattern, rate_hz)
        if files[-1].seq / rate_hz > _MAX_S:
            raise ImageFolderError(f"{files[-1].path}: {files[-1].seq} is too large for the number of an exposure")
        return files
    found: dict[int, Path] = {}
    for time, path in timed:
        if time in found:
            raise ImageFolderError(f"{path}: has the same time as {found[time].name}")
        found[time] = path
    return [ImageFile(found[time], seq, time) for seq, time in enumerate(sorted(found))]


def are_timed(files: Sequence[ImageFile]) -> bool:
    """True if the times of what `by_name` found are those in the names, not made of numbers."""
    return all(times.in_name(file.path.stem) == file.t_ns for file in files)


def _instead(folder: Path) -> str:
    """End of a message: patterns of the images in a folder and the folders in it; empty without images."""
    paths = islice(chain(folder.glob("*.*"), folder.glob("*/*.*")), _LOOKED_AT)
    there = Counter(
        (path.relative_to(folder).parent / re.sub(r"\d+", "*", path.name)).as_posix()
        for path in paths
        if path.suffix.lower() in _SUFFIXES
    )
    named = ", ".join(f"{pattern!r} ({count})" for pattern, count in sorted(there.most_common(_NAMED)))
    return f"; images there match {named}" if named else ""


def _by_all_numbers(paths: Sequence[Path], alone: bool) -> list[Path]:
    """Files that share a last number, sorted by all numbers in their names.

    Raises:
        ImageFolderError: other images are to be matched by the last number, or all numbers of two files are the same.
    """
    found: dict[tuple[int, ...], Path] = {}
    for path in paths:
        numbers = tuple(map(int, re.findall(r"\d+", path.stem)))
        key = numbers if alone else numbers[-1:]
        if key in found:
            advice = "" if alone else "; the last number tells which images belong together: let it count the exposures"
            raise ImageFolderError(f"{path}: has the same number as {found[key].name}{advice}")
        found[key] = path
    return [found[key] for key in sorted(found)]


def by_list(folder: Path, name: str) -> list[ImageFile]:
    """Files in a list of the TUM RGB-D benchmark, by time. A line has a time and a path; `#` starts a comment.

    Raises:
        ImageFolderError: missing list, malformed line, or missing file; names the line.
    """
    ordered = sorted(_listed(folder, name).items(), key=lambda item: item[1])
    return [ImageFile(path, seq, time) for seq, (path, time) in enumerate(ordered)]


def time_problem(folder: Path, name: str) -> str:
    """Problem of times that do not increase from line to line of a list, "" if they do; raises as `by_list`."""
    given = list(_listed(folder, name).values())
    earlier = sum(after <= before for before, after in pairwise(given))
    if not earlier:
        return ""
    return (
        f"the times of {earlier} of {len(given)} lines are not later than those of the line before, so the images are "
        f"taken in another order, within {(max(given) - min(given)) * 1e-9:.3g} s"
    )


def _listed(folder: Path, name: str) -> dict[Path, int]:
    """Time [ns] of each file in a list, in the order of its lines; raises as `by_list`."""
    try:
        lines = limited.read(folder / name, MAX_LIST_BYTES).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ImageFolderError(
            f"{folder / name}: cannot be read: {getattr(error, 'strerror', 'not text')}; "
            "it has a time and the path of an image in every line"
        ) from error
    listed: dict[Path, int] = {}
    for number, line in enumerate(lines, start=1):
        fields = line.partition("#")[0].split()
        if not fields:
            continue
        time = times.nanoseconds(fields[0])
        if len(fields) != 2 or time is None:
            raise ImageFolderError(
                f"{folder / name}: line {number} must be a time and a path, not {line!r}; a time is in seconds, or has "
                "13, 16 or 19 digits before the point, in ms, µs or ns"
            )
        path = folder / fields[1]
        if not path.is_file():
            raise ImageFolderError(f"{folder / name}: line {number}: there is no file {path}")
        listed[path] = time
    if not listed:
        raise ImageFolderError(f"{folder / name}: names no image")
    return listed
