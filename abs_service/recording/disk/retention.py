"""Deletes recordings that are older, or together larger, than was asked for."""

import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from abs_service.recording.disk.forecast import Growth, duration
from abs_service.recording.recording_file import ACTIVE

#: Beside a recording, `x.mcap.keep` for `x.mcap`: it is never deleted.
KEEP = ".keep"


#: 2020: no recording of this service is older. What seems to be was recorded by a clock without battery, which begins
#: in 1970 at each start [ns since the epoch].
OLDEST_NS = 1_577_836_800_000_000_000


@dataclass(frozen=True, slots=True)
class RetainedFile:
    """A file of the recorder: its name, size [bytes] and time of its last change [ns since the epoch]."""

    name: str
    size: int
    mtime_ns: int


class Ages:
    """Ages of recordings, which no step of the wall clock changes.

    It is asked for once, and tells how old those are that are there already. What comes later counts from the last time
    at which it was seen unfinished.

    A clock that follows no time server may be wrong by years, as without a battery, and all that is older would be
    deleted at once. Until it follows one, a time longer than `retain_s` in which nothing was recorded is no part of an
    age. For the same reason, `restic forget --keep-within` counts from the latest snapshot.

    Nobody knows the age of what was recorded before `OLDEST_NS`: it counts from now on.

    Args:
        wall: wall-clock time of a time of the monotonic clock [ns].
        retain_s: age at which a recording is deleted [s].
        is_synchronised: whether the wall clock follows a time server.

    Attributes:
        doubt: which time is no part of the ages, in words; "" if there is none.
    """

    def __init__(self, wall: Callable[[int], int], retain_s: float, is_synchronised: Callable[[], bool]) -> None:
        self._wall, self._retain_s, self._is_synchronised = wall, retain_s, is_synchronised
        self._changed_ns: dict[str, int] | None = None  # by name, CLOCK_MONOTONIC [ns]
        self._doubted: frozenset[str] = frozenset()  # names
        self.doubt = ""

    def of(self, files: Sequence[RetainedFile], now_ns: int) -> dict[str, int]:
        """Times since the last change of all files that there are, oldest first, by name [ns]."""
        before, names = self._changed_ns, {file.name: file.name.removesuffix(ACTIVE) for file in files}
        if before is None or (self.doubt and self._is_synchronised()):
            self._changed_ns = self._by_wall_clock(files, now_ns)
        else:
            self._changed_ns = {
                name: before.get(name, now_ns) if name == there else now_ns for there, name in names.items()
            }
        if self._doubted.isdisjoint(self._changed_ns):
            self.doubt = ""
        return {there: now_ns - self._changed_ns[name] for there, name in names.items()}

    def _by_wall_clock(self, files: Sequence[RetainedFile], now_ns: int) -> dict[str, int]:
        """Times of the last change by the wall clock, by name, CLOCK_MONOTONIC [ns]."""
        changed_ns, doubted, is_trusted = {}, list[str](), self._is_synchronised()
        left_out_ns, later_ns, wall_ns = 0, now_ns, self._wall(0)
        for file in reversed(files):
            t_ns = min(file.mtime_ns - wall_ns, now_ns) if file.mtime_ns >= OLDEST_NS else now_ns
            if not is_trusted and later_ns - t_ns > self._retain_s * 1e9:
                left_out_ns += later_ns - t_ns
            later_ns, name = t_ns, file.name.removesuffix(ACTIVE)
            changed_ns[name] = t_ns + left_out_ns
            doubted += [name] if left_out_ns else []
        self._doubted = frozenset(doubted)
        self.doubt = f"nothing was recorded for {duration(left_out_ns * 1e-9)}" if doubted else ""
        return changed_ns


@dataclass(frozen=True, slots=True)
class Retention:
    """Limits of age and size of the recordings in a folder.

    Only files with the names that a recorder of this rig gives them count, and those beside which there is a file
    `*.keep` do not: they are never deleted. An unfinished file is never deleted either, but its size counts.

    Attributes:
        directory: the folder.
        name: name of the rig, with which its recordings begin.
        kind: suffix of their names after the time: "", or that of the files of estimates.
        retain_s: age at which a recording is deleted [s]; infinite to keep all.
        retain_bytes: size of all recordings together beyond which the oldest are deleted; infinite to keep all.
        rotate_s, rotate_bytes: age and size at which a file ends, for `growth`; 0: its size is left out of that.
    """

    directory: Path
    name: str
    kind: str
    retain_s: float
    retain_bytes: float
    rotate_s: float = 0.0
    rotate_bytes: float = 0.0

    def files(self) -> list[RetainedFile]:
        """The recordings that count, finished or not, oldest first; none if the folder cannot be read."""
        pattern = re.compile(
            rf"{re.escape(self.name)}_\d{{4}}-\d\d-\d\dT\d\d-\d\d-\d\dZ(_\d+)?"
            rf"{re.escape(self.kind)}(\.recovered)?\.mcap(\.broken|\.active)?"
        )
        try:
            with os.scandir(self.directory) as entries:
                named = {entry.name: entry for entry in entries if entry.name.startswith(self.name)}
        except OSError:
            return []
        found: list[RetainedFile] = []
        for name, entry in named.items():
            with suppress(OSError):  # it is deleted at this moment, is a loop of links, or its disk does not tell
                if pattern.fullmatch(name) and name + KEEP not in named and entry.is_file():
                    about = entry.stat()
                    found.append(RetainedFile(name, about.st_size, about.st_mtime_ns))
        return sorted(found, key=lambda file: (file.mtime_ns, file.name))

    def growth(self, rate: float) -> Growth:
        """Growth of the recordings at a recording rate [bytes/s]."""
        one = min(self.rotate_bytes, self.rotate_s * rate)
        return Growth(rate, sum(file.size for file in self.files()), self.retain_s, self.retain_bytes, one)

    def apply(self, ages: Callable[[Sequence[RetainedFile]], dict[str, int]]) -> tuple[list[Path], list[OSError]]:
        """Deletes the files beyond the limits, by their ages [ns]; returns them, and why others cannot be deleted."""
        deleted: list[Path] = []
        failures: list[OSError] = []
        if self.retain_s == self.retain_bytes == float("inf"):
            return deleted, failures
        files = self.files()
        excess, age_ns = sum(file.size for file in files) - self.retain_bytes, ages(files)
        for file in sorted(files, key=lambda file: -age_ns[file.name]):
            if file.name.endswith(ACTIVE) or (excess <= 0 and age_ns[file.name] <= self.retain_s * 1e9):
                continue
            path = self.directory / file.name
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                failures.append(error)
                continue
            excess -= file.size
            deleted.append(path)
        return deleted, failures
