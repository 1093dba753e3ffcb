"""Writes files as a whole: an error, as on a full disk, leaves what was there before."""

import os
from pathlib import Path


def write(path: Path, content: bytes | str) -> None:
    """Writes a file under another name beside it, and then puts it in place.

    Raises:
        OSError: it cannot be written; its `filename` is `path`.
    """
    data = content.encode() if isinstance(content, str) else content
    target = Path(os.path.realpath(path))  # a link stays one
    try:
        if target.exists() and not target.is_file():
            target.write_bytes(data)  # into a pipe or a device, which nothing can take the place of
            return
        partial = target.with_name(f".{target.name}.{os.getpid()}")
        try:
            partial.write_bytes(data)
            os.replace(partial, target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
