"""Parser of PCIC messages: image chunks between `star` and `stop`.

Source: ifm3d, modules/framegrabber (Apache-2.0), and the buffer in its tests. Numbers are little-endian.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

#: `0000` and, on the wire, `L000309119\r\n0000`: the ticket, and the length of the remainder.
_START = re.compile(rb"(?P<ticket>\d{4})(?:L\d{9}\r\n(?P=ticket))?star")
_STOP = b"stop\r\n"

#: Type, size with header, header's size, header's version, width, height, pixel format, time [µs], number of the frame;
#: since version 2 also status, seconds and nanoseconds.
_HEADER = struct.Struct("<9I")
_HEADER_2 = struct.Struct("<12I")

#: dtype by pixel format; other formats have three values per pixel.
_DTYPES = {0: "u1", 1: "i1", 2: "<u2", 3: "<i2", 4: "<u4", 5: "<i4", 6: "<f4"}


class ChunkError(ValueError):
    """Malformed bytes of a PCIC message."""


class ChunkType(IntEnum):
    """The supported chunks."""

    DISTANCE = 100
    NORMALIZED_AMPLITUDE = 101
    DISTANCE_NOISE = 105
    CONFIDENCE = 300
    TOF_INFO = 420


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """One chunk.

    Attributes:
        type: a `ChunkType` or any other number.
        frame: number of the exposure.
        time_ns: time of the exposure on the camera's clock [ns].
        width, height: of the image [px].
        pixel_format: number of the format of its pixels.
        content: payload, padding included.
    """

    type: int
    frame: int
    time_ns: int
    width: int
    height: int
    pixel_format: int
    content: memoryview

    def image(self) -> NDArray[np.generic]:
        """The image (height, width).

        Raises:
            ChunkError: a multi-channel pixel format, or too few bytes.
        """
        if self.pixel_format not in _DTYPES:
            raise ChunkError(f"chunk {self.type}: pixel format {self.pixel_format} is none of {sorted(_DTYPES)}")
        dtype = np.dtype(_DTYPES[self.pixel_format])
        needed = self.width * self.height * dtype.itemsize
        if not 0 < needed <= len(self.content):
            size = f"{self.width} × {self.height} × {dtype.itemsize}"
            raise ChunkError(f"chunk {self.type}: {size} needs {needed} bytes (more than 0), has {len(self.content)}")
        return np.frombuffer(self.content[:needed], dtype).reshape(self.height, self.width)


def messages(data: bytes) -> Iterator[dict[int, Chunk]]:
    """Chunks of every message, by type.

    Raises:
        ChunkError: malformed or truncated message; names the byte offset.
    """
    view, position = memoryview(data), 0
    while position < len(data):
        start = _START.match(data, position)
        if start is None:
            raise ChunkError(
                f"byte {position}: a message begins with four digits and `star`, not {data[position:][:8]!r}"
            )
        chunks, position = {}, start.end()
        while not data.startswith(_STOP, position):
            chunk, position = _chunk(view, position)
            chunks[chunk.type] = chunk
        position += len(_STOP)
        yield chunks


def _chunk(data: memoryview, position: int) -> tuple[Chunk, int]:
    """The chunk at an offset, and the offset after it."""
    rest = data[position:]
    if len(rest) < _HEADER.size:
        raise ChunkError(f"byte {position}: the message is cut off before its `stop`")
    kind, size, header, version, width, height, pixel_format, time_us, frame = _HEADER.unpack_from(rest)
    fixed = _HEADER_2.size if version >= 2 else _HEADER.size
    if not fixed <= header <= size:
        raise ChunkError(f"byte {position}: a chunk of {size} bytes cannot have a header of {header}")
    if size > len(rest):
        raise ChunkError(f"byte {position}: a chunk of {size} bytes does not fit into the {len(rest)} that are left")
    seconds, nanoseconds = _HEADER_2.unpack_from(rest)[10:] if version >= 2 else (0, time_us * 1000)
    time_ns = seconds * 1_000_000_000 + nanoseconds
    chunk = Chunk(kind, frame, time_ns, width, height, pixel_format, rest[header:size])
    return chunk, position + size
