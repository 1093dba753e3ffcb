"""One recording on disk, from its first byte to its final name."""

import contextlib
import errno
import fcntl
import os
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, cast

from drivers.encoding.mcap_file import CHUNK_SIZE, Compression, McapFile

#: Added to the name while the file is written; a file that still has it and is not locked was interrupted.
ACTIVE = ".active"
#: End of the name of the file that has the estimates alone.
ESTIMATES = "_estimates"

#: Bytes that gather in memory before the disk begins to write them, without waiting for it.
BEGUN_SIZE = 8 << 20


def private(path: str, flags: int) -> int:
    """Opener of a recording, which shows people: its owner may write it, its group may read it, no others may."""
    return os.open(path, flags, 0o640)


def open_for_writing(path: Path) -> BinaryIO:
    """Creates a file that must not exist yet.

    Writes go to its end: after it was cut, others would leave a hole as long as what is missing.
    """
    return open(path, "xb", opener=lambda name, flags: private(name, flags | os.O_APPEND))


def lock(stream: BinaryIO, path: Path) -> None:
    """Locks an open file against other processes as long as it is open; `path` is where it is.

    Raises:
        BlockingIOError: another process has locked it.
        OSError: its file system has no locks.
    """
    try:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno != errno.EBADF:
                raise
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)  # all that NFS allows who only reads, see flock(2)
    except BlockingIOError:
        raise
    except OSError as error:
        lacking = f"{path.parent} is on a file system without locks ({error.strerror})"
        remedy = "mount it with them (NFS: `local_lock=flock`), or set record.directory to a folder on another one"
        raise OSError(error.errno, f"{lacking}: {remedy}") from None


class _Counted:
    """A stream that counts the bytes that it is given, since the size of the file may be another's doing."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = 0
        self.fileno, self.flush, self.close = stream.fileno, stream.flush, stream.close

    def write(self, data: bytes) -> int:
        self.size += len(data)
        return self._stream.write(data)

    def tell(self) -> int:
        return self.size


class RecordingFile:
    """An MCAP file that is called `*.mcap.active` until it is complete.

    The file is locked as long as this process lives and writes, so that no other process recovers it.

    Args:
        path: its final path, see `free_path`.
        wall_ns: wall-clock time of its beginning [ns].
        attachments: texts to attach at the start, by name.
        compression, chunk_size: see `McapFile`.
        open_file: creates the stream; a test may give a slow or full one.

    Raises:
        OSError: the file cannot be created or does not take the attachments.
    """

    def __init__(
        self,
        path: Path,
        wall_ns: int,
        attachments: Mapping[str, str],
        compression: Compression = Compression.LZ4,
        chunk_size: int = CHUNK_SIZE,
        open_file: Callable[[Path], BinaryIO] = open_for_writing,
    ) -> None:
        self.path = path
        self._active = self.path.with_name(self.path.name + ACTIVE)
        self._whole = 0  # size of the finished file
        self._begun = 0  # size up to which writing to the disk has begun
        self._stream = _Counted(open_file(self._active))
        try:
            lock(cast(BinaryIO, self._stream), self._active)
            self._file = McapFile(cast(BinaryIO, self._stream), compression, chunk_size)
            for attachment, text in attachments.items():
                self._file.attach(attachment, "text/toml", text.encode(), wall_ns)
            self.flush()
        except OSError:
            self.abandon().unlink(missing_ok=True)  # it holds no message
            raise

    @property
    def size(self) -> int:
        """Bytes written so far, but for the open chunk; of a finished file, all."""
        return self._whole or self._stream.size

    @property
    def fate(self) -> str:
        """Change of the unfinished file from outside, "deleted" or "moved"; "" if it is in its place."""
        mine = os.fstat(self._stream.fileno())
        if mine.st_nlink == 0:
            return "deleted"
        try:
            there = os.stat(self._active)
        except OSError:
            return "moved"
        return "" if os.path.samestat(mine, there) else "moved"

    def write(self, topic: str, message: str, payload: bytes, stamp_ns: int, seq: int) -> None:
        """Appends one message; see `McapFile.write`. After an `OSError` only `abandon` makes sense."""
        self._file.write(f"/{topic}", message, payload, stamp_ns, seq)
        if (size := self.size) > self._begun + BEGUN_SIZE:
            self._begun = size
            self._let_go()

    def attach(self, name: str, media_type: str, text: str, stamp_ns: int) -> None:
        """Adds an attachment, at the start or later; see `McapFile.attach`."""
        self._file.attach(name, media_type, text.encode(), stamp_ns)

    def flush(self) -> None:
        """Flushes to the disk (fdatasync): what was written survives a kill and a power failure.

        Raises:
            OSError: the disk does not take it, or another program has cut the file or added to it.
        """
        self._file.flush()
        os.fdatasync(self._stream.fileno())
        self._check_size()
        self._let_go()

    def _check_size(self) -> None:
        if os.fstat(self._stream.fileno()).st_size != self._stream.size:
            raise OSError(f"{self.path.name} was changed by another program while it was written")

    def _let_go(self) -> None:
        """Begins to write pages to the disk, and leaves those that are there to others, since nobody reads them soon.

        All of a second at once would keep others from the disk; and the system takes longer to find new pages for the
        next messages, which would be those of other programs.
        """
        os.posix_fadvise(self._stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)

    def finish(self, summary: Mapping[str, str]) -> Path:
        """Writes `summary` as metadata and the index, closes the file and gives it its final name, which it returns.

        Where it or its folder was moved, it gets that name there.

        Raises:
            OSError: as `flush`; what is left is to be recovered, and must not look complete.
        """
        self._file.describe("abs.recording", summary)
        self._file.finish()
        os.fsync(self._stream.fileno())
        self._check_size()
        self._whole = self.size
        now = Path(os.readlink(f"/proc/self/fd/{self._stream.fileno()}"))
        self._stream.close()
        with contextlib.suppress(FileNotFoundError):  # it was deleted
            os.rename(now, now.with_name(self.path.name))
        return self.path

    def abandon(self) -> Path:
        """Closes the file unfinished, to be recovered later; returns its path."""
        with contextlib.suppress(OSError):  # closing tries once more to write what the disk did not take
            self._stream.close()
        return self._active


def estimates_path(path: Path) -> Path:
    """The file beside a recording that has its estimates alone: `x_estimates.mcap` beside `x.mcap`."""
    return path.with_name(f"{path.stem}{ESTIMATES}.mcap")


def free_path(directory: Path, name: str, wall_ns: int) -> Path:
    """A path for a recording that no finished, unfinished or recovered one uses, nor that of the estimates beside it.

    Args:
        directory: where it goes.
        name: its beginning; the time follows.
        wall_ns: wall-clock time of its beginning [ns].
    """
    start = f"{name}_{datetime.fromtimestamp(wall_ns // 10**9, UTC):%Y-%m-%dT%H-%M-%SZ}"
    names = (one for one in os.listdir(directory) if one.startswith(start))  # of perhaps 100,000
    taken = {one.split(".")[0].removesuffix(ESTIMATES) for one in names}
    counter = 1
    stem = start
    while stem in taken:
        counter += 1
        stem = f"{start}_{counter}"
    return directory / f"{stem}.mcap"
