"""Deletes recordings that are older, or together larger, than was asked for."""

import os
import re
from dataclasses import dataclass
from pathlib import Path

from abs_service.recording.disk.forecast import Growth

#: Beside a recording, `x.mcap.keep` for `x.mcap`: it is never deleted.
KEEP = ".keep"


@dataclass(frozen=True, slots=True)
class Kept:
    """A file of the recorder: its path, size [bytes] and time of its last change [ns since the epoch]."""

    path: Path
    size: int
    mtime_ns: int


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
    """

    directory: Path
    name: str
    kind: str
    retain_s: float
    retain_bytes: float

    def files(self) -> list[Kept]:
        """The recordings that count, finished or not, oldest first; none if the folder cannot be read."""
        pattern = re.compile(
            rf"{re.escape(self.name)}_\d{{4}}-\d\d-\d\dT\d\d-\d\d-\d\dZ(_\d+)?"
            rf"{re.escape(self.kind)}(\.recovered)?\.mcap(\.broken|\.active)?"
        )
        try:
            names = set(os.listdir(self.directory))
        except OSError:
            return []
        found: list[Kept] = []
        for name in names:
            path = self.directory / name
            if pattern.fullmatch(name) and name + KEEP not in names and path.is_file():
                about = path.stat()
                found.append(Kept(path, about.st_size, about.st_mtime_ns))
        return sorted(found, key=lambda file: (file.mtime_ns, file.path))

    def growth(self, rate: float) -> Growth:
        """Growth of the recordings at a recording rate [bytes/s]."""
        return Growth(rate, sum(file.size for file in self.files()), self.retain_s, self.retain_bytes)

    def apply(self, wall_ns: int) -> list[Path]:
        """Deletes the files beyond the limits, and returns them.

        Args:
            wall_ns: the present [ns since the epoch].

        Raises:
            OSError: a file cannot be deleted.
        """
        if self.retain_s == self.retain_bytes == float("inf"):
            return []
        files = self.files()
        excess = sum(file.size for file in files) - self.retain_bytes
        deleted: list[Path] = []
        for file in files:
            if file.path.suffix == ".active":
                continue
            if excess > 0 or wall_ns - file.mtime_ns > self.retain_s * 1e9:
                file.path.unlink(missing_ok=True)
                excess -= file.size
                deleted.append(file.path)
        return deleted
