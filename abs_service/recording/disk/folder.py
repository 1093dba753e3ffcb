"""The folder of recordings: whether it can be used."""

import errno
import os
import os.path
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

#: What is wrong with a disk, not with a configuration: recording begins when it is over.
_OF_THE_DISK = frozenset({errno.ENODEV, errno.EROFS, errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.ESTALE})

#: Time that the disk has to answer [s].
PATIENCE_S = 2.0

#: What the disk has to take, which is more than the beginning of a recording [bytes].
SAMPLE_BYTES = 1 << 20


class FolderError(Exception):
    """The folder for recordings cannot be used."""


def check(directory: Path) -> None:
    """Makes the folder, and looks whether it can be written.

    Nothing is written to it: on a disk that stands still, whoever does cannot even be killed.

    Raises:
        FolderError: the configuration or the folder's permissions have to be changed. A disk that is full, broken,
            mounted to be read only, does not answer, or is not there where a link leads to it, is none of that: the
            recorder reports it, and all else goes on.
    """
    found: list[FolderError] = []
    # Nothing can end a call that waits for the disk, of a server that is gone, say.
    thread = threading.Thread(target=lambda: found.extend(_mistakes(directory)), name="check folder", daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    if found:
        raise found[0]


def make(directory: Path) -> None:
    """Makes the folder, and those that it is in.

    Raises:
        OSError: it cannot be made; of ENODEV, since a link leads to nothing, as to a disk that is not there.
    """
    if directory.is_dir():  # else a disk that stands still would be waited for
        return
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        if os.path.islink(there := error.filename):
            nothing = f"{there} is a link to {os.readlink(there)}, where nothing is"
            raise OSError(errno.ENODEV, nothing) from None
        raise NotADirectoryError(errno.ENOTDIR, f"{there} is no folder") from None


def takes(directory: Path) -> bool:
    """True if the disk takes a file of some size, which is gone at once."""
    try:
        with tempfile.TemporaryFile(dir=directory, buffering=0) as file:
            written = file.write(os.urandom(SAMPLE_BYTES))
            os.fdatasync(file.fileno())
    except OSError:
        return False
    return written == SAMPLE_BYTES


def mount_point(directory: Path) -> Path:
    """The folder at which the file system of an existing folder is mounted."""
    path = Path(os.path.realpath(directory))
    while not os.path.ismount(path):
        path = path.parent
    return path


def check_mounted(mount: Path) -> None:
    """Checks that a file system is there, in whose place would be an empty folder of another one, often the system's.

    Raises:
        OSError: nothing is mounted there.
    """
    if not os.path.ismount(mount):
        raise OSError(f"the disk at {mount} is not mounted any more")


def check_inodes(directory: Path) -> None:
    """Checks that the file system of an existing folder can hold one more file: many small ones use up its inodes.

    Raises:
        OSError: it cannot, which the system would call a lack of space.
    """
    disk = os.statvfs(directory)
    if disk.f_files and not disk.f_favail:  # some file systems have no limit, and say 0 of 0
        files = f"its {disk.f_files} files are as many as it can hold"
        raise OSError(f"no inode is left on the disk of {directory}: {files}; delete some, however small")


def _mistakes(directory: Path) -> Iterator[FolderError]:
    try:
        make(directory)
        disk = os.statvfs(directory)
        if not disk.f_blocks:
            yield FolderError(f'record.directory = "{directory}": cannot be written: its file system keeps no files')
        elif not (disk.f_flag & os.ST_RDONLY or os.access(directory, os.W_OK | os.X_OK)):
            yield FolderError(f'record.directory = "{directory}": cannot be written: {os.strerror(errno.EACCES)}')
    except OSError as error:
        if error.errno not in _OF_THE_DISK:
            yield FolderError(f'record.directory = "{directory}": cannot be made: {error.strerror}')
