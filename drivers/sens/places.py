"""Places of the images in a .sens file: only the headers of its frames are read."""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import BinaryIO

from drivers.sens.header import Header, SensError

#: Largest image in a file, compressed or not [bytes].
MAX_BYTES = 1 << 28

#: Pose of the camera in the scene, time stamps of colour and depth [µs], their sizes [bytes].
_FRAME = struct.Struct("<16f4Q")


@dataclass(frozen=True, slots=True)
class Place:
    """One image.

    Attributes:
        time_us: its time stamp [µs].
        offset, size: of its content in the file [bytes]; without content the frame has no such image.
    """

    time_us: int
    offset: int
    size: int


@dataclass(frozen=True, slots=True)
class FramePlaces:
    """The images of a frame.

    Attributes:
        number: of the frame, from 0.
        images: where they are, `depth` and `color`.
    """

    number: int
    images: Mapping[str, Place]


def places(stream: BinaryIO, header: Header) -> Iterator[FramePlaces]:
    """Every frame of a file, in its order. Others may seek in the stream meanwhile.

    Raises:
        SensError: a frame that is cut off, or has an image that is larger than allowed.
    """
    file_size, position = stream.seek(0, 2), header.end
    for number in range(header.count):
        named = f"frame {number} of {header.count}"
        whole = f"; the frames before it are whole: {number}" if number else ""
        stream.seek(position)
        head = stream.read(_FRAME.size)
        if len(head) < _FRAME.size:
            raise SensError(f"{named} is cut off: the file ends at byte {file_size}{whole}")
        *_, color_us, depth_us, color_size, depth_size = _FRAME.unpack(head)
        for name, size in (("color", color_size), ("depth", depth_size)):
            if size > MAX_BYTES:
                raise SensError(f"{named}: {name}_size_bytes = {size}: {MAX_BYTES} are allowed{whole}")
        color = Place(color_us, position + _FRAME.size, color_size)
        depth = Place(depth_us, color.offset + color_size, depth_size)
        position = depth.offset + depth_size
        if position > file_size:
            raise SensError(f"{named} is cut off: it ends at byte {position}, the file at byte {file_size}{whole}")
        yield FramePlaces(number, {"depth": depth, "color": color})
