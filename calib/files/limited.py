"""Reads files up to a size. Pipes, devices and other files without a size are refused."""

import errno
import io
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from zipfile import BadZipFile, ZipFile

from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

#: Largest text: a configuration, a calibration, a list of images [bytes].
MAX_TEXT_BYTES = 1 << 20
#: Largest file with the arrays of a noise model or of covariances, compressed or not [bytes].
MAX_ARRAYS_BYTES = 1 << 28


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Opens a regular file of any size.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    with open(path, "rb", opener=_without_waiting) as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        yield stream


def read(path: Path, maximum: int) -> bytes:
    """The content of a file.

    Raises:
        OSError: it cannot be read, is no regular file, or is larger.
    """
    with opened(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = stream.read(maximum + 1) if size <= maximum else b""
        if max(size, len(content)) > maximum:
            raise OSError(errno.EFBIG, f"it is larger than {maximum} bytes", str(path))
        return content


def text(path: Path) -> str:
    """The text of a file, in UTF-8, without the byte order mark that some editors put before it.

    Raises:
        OSError: as `read`.
        UnicodeDecodeError: other bytes.
    """
    return read(path, MAX_TEXT_BYTES).decode("utf-8-sig")


def arrays(path: Path) -> dict[str, NDArray]:
    """The arrays of an .npz file, by name.

    Raises:
        OSError: as `read`.
        ValueError: it is no .npz, or its arrays are too large together.
    """
    return unpacked(read(path, MAX_ARRAYS_BYTES))


def unpacked(content: bytes) -> dict[str, NDArray]:
    """The arrays in the bytes of an .npz file, by name.

    Raises:
        ValueError: they are none, or too large together.
    """
    try:
        with ZipFile(io.BytesIO(content)) as parts:
            size = sum(part.file_size for part in parts.infolist())
        if size > MAX_ARRAYS_BYTES:
            raise ValueError(f"its arrays have {size} bytes, {MAX_ARRAYS_BYTES} are allowed")
        with NpzFile(io.BytesIO(content)) as archive:
            return dict(archive)
    # What NumPy and zlib make of damaged bytes, and of an array that claims to be larger than its part of the file.
    except (
        BadZipFile,
        EOFError,
        KeyError,
        MemoryError,
        NotImplementedError,
        OSError,
        RuntimeError,
        zlib.error,
    ) as error:
        raise ValueError(f"damaged: {error}") from error


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)  # or to open a pipe would wait for somebody who writes to it
