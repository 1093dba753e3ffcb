"""The folder of recordings: whether it can be used."""

import errno
import tempfile
from pathlib import Path

#: What is wrong with a disk, not with a configuration: recording begins when it is over.
_OF_THE_DISK = frozenset({errno.EROFS, errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.ESTALE})


class FolderError(Exception):
    """The folder for recordings cannot be used."""


def check(directory: Path) -> None:
    """Makes the folder, and a file in it that is gone at once.

    Raises:
        FolderError: the configuration or the folder's permissions have to be changed. A disk that is full, broken or
            mounted to be read only is none of that: the recorder reports it, and all else goes on.
    """
    action = "made"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        action = "written"
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        if error.errno not in _OF_THE_DISK:
            raise FolderError(f'record.directory = "{directory}": cannot be {action}: {error.strerror}') from None
