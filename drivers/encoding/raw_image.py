"""Wire format of `foxglove.RawImage`, without copies of its pixels.

The protobuf library copies the pixels into a message, out of it, and once more when it serialises. Here all other
fields pass through the library, and the pixels from buffer to buffer. Source: "Message Structure" on the page
"Encoding" of protobuf's documentation.
"""

from collections.abc import Iterator
from itertools import count

import numpy as np
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

_PIXELS = RawImage.DESCRIPTOR.fields_by_name["data"].number

#: Wire types, and number of bytes of those of fixed size.
_VARINT, _BYTES = 0, 2
_FIXED = {1: 8, 5: 4}

#: Most fields of a message; there are seven.
_MAX_FIELDS = 100

#: Largest number of bytes of a varint: 64 bits, seven in each.
_MAX_BYTES = 10


def serialize(image: RawImage, pixels: NDArray) -> bytes:
    """The serialised message `image`, which has no pixels, with these."""
    own = image.SerializeToString()
    begin = bytes((_PIXELS << 3 | _BYTES,)) + bytes(_written(pixels.nbytes))
    return b"".join((own, begin, np.ascontiguousarray(pixels).data))


def parse(payload: bytes) -> tuple[RawImage, memoryview]:
    """The message without its pixels, and a view of these within `payload`; as in protobuf, the last field counts.

    Raises:
        DecodeError: malformed bytes.
    """
    whole, pixels, rest, position, kept, fields = memoryview(payload), memoryview(b""), [], 0, 0, 0
    while position < len(whole):
        begin, fields = position, fields + 1
        if fields > _MAX_FIELDS:
            raise DecodeError(f"more than {_MAX_FIELDS} fields")
        key, position = _varint(whole, position)
        size, position = _size(whole, position, key & 7)
        if position + size > len(whole):
            raise DecodeError(f"field {key >> 3} ends after the message")
        if key == _PIXELS << 3 | _BYTES:
            pixels = whole[position : position + size]
            rest.append(whole[kept:begin])
            kept = position + size
        position += size
    rest.append(whole[kept:])
    return RawImage.FromString(b"".join(rest)), pixels


def _size(whole: memoryview, position: int, wire_type: int) -> tuple[int, int]:
    """Number of bytes of a field's value, and where it begins."""
    if wire_type == _VARINT:
        return _varint(whole, position)[1] - position, position
    if wire_type == _BYTES:
        return _varint(whole, position)
    if wire_type in _FIXED:
        return _FIXED[wire_type], position
    raise DecodeError(f"wire type {wire_type} at byte {position}")


def _varint(whole: memoryview, position: int) -> tuple[int, int]:
    """A number of variable length, and where it ends."""
    value = 0
    for shift in range(0, 7 * _MAX_BYTES, 7):
        if position >= len(whole):
            break
        byte = whole[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
    raise DecodeError(f"no number ends before byte {position}")


def _written(number: int) -> Iterator[int]:
    """Bytes of a number of variable length."""
    for shift in count(0, 7):
        more = number >> shift >= 0x80
        yield number >> shift & 0x7F | (0x80 if more else 0)
        if not more:
            return
