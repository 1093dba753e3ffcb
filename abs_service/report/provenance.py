"""Provenance of a result: command, date, version, and data with their hashes."""

import hashlib
import shlex
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import abs_service


class DataError(Exception):
    """Data of a result that cannot be read."""


@dataclass(frozen=True, slots=True)
class DataFile:
    """A file or a folder that a result was computed from.

    Attributes:
        name: its name without its folders, which differ between machines and may be private.
        sha256: hash of the content; of a folder, that of all its files with their names.
    """

    name: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Provenance:
    """Provenance of a result.

    Attributes:
        command: command line that computed it; the home folder is written as `~`.
        date: when, ISO 8601 in UTC.
        version: of the program.
        data: inputs of the computation.
    """

    command: str
    date: str
    version: str = abs_service.__version__
    data: tuple[DataFile, ...] = ()


def trace(
    arguments: Sequence[str],
    data: Sequence[Path],
    clock: Callable[[], int] = time.time_ns,
    home: Path | None = None,
    program: str = "abs-service",
) -> Provenance:
    """The provenance of a command's result, before it computes.

    Args:
        arguments: command line after the program's name.
        data: files and folders that it reads.
        clock: wall-clock time [ns since the epoch].
        home: folder that is written as `~`; None for the user's.
        program: name of the program on the command line.

    Raises:
        DataError: one of the files cannot be read.
    """
    away = str(Path.home() if home is None else home).rstrip("/")
    shown = [argument.replace(f"{away}/", "~/") if away else argument for argument in arguments]
    date = datetime.fromtimestamp(clock() // 1_000_000_000, UTC).isoformat().replace("+00:00", "Z")
    command = " ".join([program, *map(_quoted, shown)])
    return Provenance(command, date, data=tuple(fingerprint(path) for path in data))


def commit(folder: Path) -> str:
    """The commit that a folder is a checkout of, with a + if files were changed; "" if it is none."""
    try:
        answers = [
            subprocess.run(["git", *what], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()
            for what in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        ]
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"{answers[0]}+" if answers[1] else answers[0]


def fingerprint(path: Path) -> DataFile:
    """Name and hash of a file, or of a folder with everything in it.

    Raises:
        DataError: it cannot be read.
    """
    try:
        resolved = path.resolve()
        if not resolved.is_dir():
            return DataFile(resolved.name, _sha256(resolved))
        digest = hashlib.sha256()
        for file in sorted(file for file in resolved.rglob("*") if file.is_file()):
            digest.update(f"{_sha256(file)} {file.relative_to(resolved).as_posix()}\n".encode())
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    return DataFile(f"{resolved.name}/", digest.hexdigest())


def _quoted(argument: str) -> str:
    # A quoted ~ would no longer be the home folder to a shell.
    return f"~/{shlex.quote(argument[2:])}" if argument.startswith("~/") else shlex.quote(argument)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
