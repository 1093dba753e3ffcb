"""Recovers recordings that are truncated or damaged."""

import contextlib
import fcntl
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.writer import MCAP0_MAGIC

from abs_service.recording.disk.file_bytes import FileBytes
from abs_service.recording.mcap_scan import find_chunk
from abs_service.recording.recording_file import ACTIVE, lock, private
from abs_service.recording.salvage import Salvage
from calib.files import limited

BROKEN = ".broken"
RECOVERING = ".recovering"


class RecoveryError(Exception):
    """A file that cannot be recovered; the message has the reason."""


class InUseError(RecoveryError):
    """A file that another process, or another part of this one, is writing or recovering."""


@dataclass(frozen=True, slots=True)
class RecoveryReport:
    """Result of a recovery.

    Attributes:
        source: path of the original now; None if all of it was recovered and it was deleted.
        target: the file with all that could be read, complete with an index.
        messages: messages saved.
        chunks: chunks saved.
        damaged: chunks and attachments left out because their checksum is wrong.
        orphans: messages left out because their channel is unknown.
        skipped_bytes: bytes that are no record, such as a torn end.
    """

    source: Path | None
    target: Path
    messages: int
    chunks: int
    damaged: int
    orphans: int
    skipped_bytes: int

    def __str__(self) -> str:
        saved = f"{self.target}: {self.messages} messages in {self.chunks} chunks saved"
        if self.source is None:
            return f"{saved}, nothing lost"
        lost = f"{self.damaged} damaged chunks, {self.orphans} unknown messages and {self.skipped_bytes} bytes left out"
        return f"{saved}; {lost}; the original is {self.source}"


def recover(source: Path, directory: Path | None = None) -> RecoveryReport:
    """Copies all readable records of `source` to a new indexed file in the same folder, or in `directory`.

    `x.mcap.active` becomes `x.mcap`, and itself `x.mcap.broken` unless all of it was saved. Of any other file, `x.mcap`
    say, the result is `x.recovered.mcap` and the original stays, as it always does with a `directory`. The new file has
    its name only when it is complete; to recover again after an interruption is safe. Nothing is overwritten.

    Raises:
        RecoveryError: the file cannot be read, is no MCAP file, (InUseError) another process is writing it, or there
            is a file of the new one's name.
        OSError: the new file cannot be written.
    """
    was_active = source.name.endswith(ACTIVE)
    name = source.name.removesuffix(ACTIVE) if was_active else f"{source.name.removesuffix('.mcap')}.recovered.mcap"
    target = (directory or source.parent) / name
    unfinished = target.with_name(target.name + RECOVERING)
    with _locked(source) as stream:
        if target.exists():
            raise RecoveryError(f"{source}: {target} is there already; move it away, or name another folder with --out")
        data = _content(source, stream)
        try:
            with open(unfinished, "wb", opener=private) as output:
                fcntl.flock(output, fcntl.LOCK_EX)  # for `remove_interrupted`
                salvage = Salvage(data, output)
                salvage.run()
                output.flush()
                os.fsync(output.fileno())
        except OSError:
            unfinished.unlink(missing_ok=True)
            raise
        lossless = not (salvage.damaged or salvage.orphans or salvage.skipped_bytes)
        replaces, kept, complete = was_active and directory is None, source, unfinished
        if replaces and lossless:
            with contextlib.suppress(OSError):  # somebody else's in a folder like /tmp
                os.replace(unfinished, source)  # never are there two copies, whenever power fails
                kept, complete = None, source
        os.replace(complete, target)
        if replaces and complete is unfinished:
            kept = source.unlink() if lossless else set_aside(source)
    return RecoveryReport(
        kept,
        target,
        salvage.messages,
        salvage.chunks,
        salvage.damaged,
        salvage.orphans,
        salvage.skipped_bytes,
    )


def leftovers(directory: Path) -> dict[Path, float]:
    """Recordings in `directory` that were not finished, oldest first, with the Unix time of their last change [s].

    Some may still be written by another process. What is no file, or a link to nothing, is left out.
    """
    found: dict[Path, float] = {}
    with contextlib.suppress(OSError):
        for path in directory.glob(f"*.mcap{ACTIVE}"):
            with contextlib.suppress(OSError):
                about = path.stat()
                if stat.S_ISREG(about.st_mode):
                    found[path] = about.st_mtime
    return dict(sorted(found.items(), key=lambda one: one[1]))


def remove_interrupted(directory: Path) -> None:
    """Removes the output of a killed recovery; the next one begins with the original again."""
    with contextlib.suppress(OSError):
        for path in directory.glob(f"*{RECOVERING}"):
            # It may be somebody else's, or locked by a living one.
            with contextlib.suppress(OSError), limited.opened(path) as stream:
                lock(stream, path)
                path.unlink()


def is_in_use(source: Path) -> bool:
    """True if a process of this host is writing or recovering a recording."""
    try:
        with limited.opened(source) as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def set_aside(source: Path) -> Path:
    """Renames `x.mcap.active` to `x.mcap.broken`, which no recorder finishes; returns the new path.

    Raises:
        OSError: it cannot be renamed.
    """
    broken = source.with_name(source.name.removesuffix(ACTIVE) + BROKEN)
    os.replace(source, broken)
    return broken


@contextlib.contextmanager
def _locked(source: Path) -> Iterator[BinaryIO]:
    with contextlib.ExitStack() as stack:
        try:
            stream = stack.enter_context(limited.opened(source))
        except OSError as error:
            raise RecoveryError(f"{source}: cannot be read: {error.strerror}") from None
        try:
            lock(stream, source)
        except BlockingIOError:
            raise InUseError(f"{source}: another process is writing or recovering it") from None
        yield stream


def _content(source: Path, stream: BinaryIO) -> FileBytes:
    data = FileBytes(stream.fileno())
    if not len(data):
        raise RecoveryError(f"{source}: the file is empty; nothing was recorded")
    if data[: len(MCAP0_MAGIC)] != MCAP0_MAGIC and find_chunk(data, 0) == len(data):
        raise RecoveryError(f"{source}: holds no MCAP record")
    return data
