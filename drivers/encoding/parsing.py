"""Parsing of messages from other programs, and of the pixels in those of images: all or a `CodecError`."""

from typing import TypeVar

import numpy as np
from absmsg.v1.encoded_image_pb2 import EncodedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError, Message

from drivers.contract.frame import ENCODINGS

_AnyMessage = TypeVar("_AnyMessage", bound=Message)


class CodecError(ValueError):
    """Malformed bytes of a frame or truth; the message names the problem."""


def parse_message(schema: type[_AnyMessage], payload: bytes) -> _AnyMessage:
    """The message of a schema in serialized bytes.

    Raises:
        CodecError: malformed bytes.
    """
    try:
        return schema.FromString(payload)
    except DecodeError as error:
        raise CodecError(f"{len(payload)} bytes are no {schema.DESCRIPTOR.full_name}: {error}") from error


def bytes_per_pixel(encoding: str) -> int:
    """Number of bytes of a pixel of one of `ENCODINGS`."""
    dtype, channels = ENCODINGS[encoding]
    return dtype.itemsize * channels


def pixels_of(name: str, image: RawImage, data: memoryview | bytes) -> np.ndarray:
    """The pixels of an image, in its shape (height, width) or (height, width, channels), from their bytes.

    Args:
        name: of the image, for errors.
        image: its size and encoding; its own pixels are not read.
        data: the pixels' bytes.

    Raises:
        CodecError: an unknown encoding, or not as many bytes as size and encoding say.
    """
    if image.encoding not in ENCODINGS:
        raise CodecError(f"{name}: encoding {image.encoding!r} is none of {sorted(ENCODINGS)}")
    dtype = ENCODINGS[image.encoding][0]
    step = image.width * bytes_per_pixel(image.encoding)
    if image.step != step:
        raise CodecError(
            f"{name}: a row of {image.width} {image.encoding} pixels has {step} bytes, step is {image.step}"
        )
    if len(data) != step * image.height or not data:
        raise CodecError(
            f"{name}: {image.width} × {image.height} {image.encoding} needs {step * image.height} bytes (more than 0), "
            f"has {len(data)}"
        )
    # Where they begin is up to the sender; kernels take aligned numbers only.
    return np.require(np.frombuffer(data, dtype), requirements="A").reshape(shape_of(image))


def shape_of(image: RawImage | EncodedImage) -> tuple[int, ...]:
    """Shape of the pixels of an image, whose encoding is one of `ENCODINGS`."""
    channels = ENCODINGS[image.encoding][1]
    return (image.height, image.width) if channels == 1 else (image.height, image.width, channels)


def unpadded(data: np.ndarray, encoding: str, width: int, height: int, stride: int) -> np.ndarray:
    """A copy of an image (height, width) or (height, width, 3) from its bytes, without row padding.

    Raises:
        CodecError: too few bytes.
    """
    dtype, channels = ENCODINGS[encoding]
    row = width * channels * dtype.itemsize
    if not 0 < row <= stride or height < 1 or data.size < stride * height:
        size = f"{width} × {height} × {channels}"
        raise CodecError(f"{size} {encoding} in rows of {stride} bytes need more than {data.size} bytes")
    rows = np.asarray(data, np.uint8)[: stride * height].reshape(height, stride)[:, :row]
    image = rows.copy().view(dtype)
    return image if channels == 1 else image.reshape(height, width, channels)
