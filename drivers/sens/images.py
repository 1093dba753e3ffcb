"""Pixels of the images in a .sens file: never more than the header announces."""

import zlib
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.encoding import image_size
from drivers.sens.header import ImageHeader, SensError

_COLOR: Mapping[int, str] = {0: "raw", 1: "png", 2: "jpeg"}
_DEPTH: Mapping[int, str] = {0: "raw_ushort", 1: "zlib_ushort"}
#: Compressions that the format names, without a public decoder.
_UNREADABLE: Mapping[int, str] = {-1: "unknown"}
_COMPRESSIONS = {"color": (_COLOR, _UNREADABLE), "depth": (_DEPTH, {**_UNREADABLE, 2: "occi_ushort"})}


def check_compression(header: ImageHeader) -> None:
    """Checks that images can be decoded.

    Raises:
        SensError: they cannot.
    """
    allowed, unreadable = _COMPRESSIONS[header.name]
    if header.compression not in allowed:
        name = f" ({unreadable[header.compression]})" if header.compression in unreadable else ""
        listed = ", ".join(f"{number} ({one})" for number, one in allowed.items())
        raise SensError(f"{header.name}_compression_type = {header.compression}{name}: only {listed} can be decoded")


def depth(header: ImageHeader, content: bytes) -> NDArray[np.uint16]:
    """Depth image (height, width).

    Raises:
        SensError: no image of the size in the header.
    """
    needed = 2 * header.width * header.height
    expected = f"{header.width} × {header.height} pixels need two bytes each"
    if _DEPTH[header.compression] == "zlib_ushort":
        content = _inflated(content, needed, expected)
    if len(content) != needed:
        raise SensError(f"{expected}, there are {len(content)}")
    return np.frombuffer(content, "<u2").reshape(header.height, header.width)


def color(header: ImageHeader, content: bytes) -> tuple[str, NDArray[np.uint8]]:
    """Encoding, `rgb8` or `bgr8`, and pixels (height, width, 3) of a colour image.

    Raises:
        SensError: no image of the size in the header.
    """
    expected = f"{header.width} × {header.height} pixels"
    if _COLOR[header.compression] == "raw":
        if len(content) != 3 * header.width * header.height:
            raise SensError(f"{expected} need three bytes each, there are {len(content)}")
        return "rgb8", np.frombuffer(content, np.uint8).reshape(header.height, header.width, 3)
    try:
        width, height = image_size.check(content)
        if (width, height) != (header.width, header.height):
            raise SensError(f"the image has {width} × {height} pixels, the header says {expected}")
        if image_size.is_cut_off(content):
            raise SensError("the image is truncated: its end is missing")
        # A camera file's pixels are those of its camera matrix, which knows nothing of a turn that EXIF asks for.
        image = image_size.decoded(content, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except image_size.ImageSizeError as error:
        raise SensError(str(error)) from error
    if image.shape != (header.height, header.width, 3):
        raise SensError(f"this cannot be decoded as an image of {expected}")
    return "bgr8", image.astype(np.uint8, copy=False)


def _inflated(content: bytes, needed: int, expected: str) -> bytes:
    """The bytes in a zlib stream; of one with more than needed, no more than one byte is made."""
    inflater = zlib.decompressobj()
    try:
        inflated = inflater.decompress(content, needed + 1)
    except zlib.error as error:
        raise SensError(f"this is no zlib stream: {error}") from error
    if len(inflated) > needed:
        raise SensError(f"{expected}, the zlib stream has more")
    if not inflater.eof:
        raise SensError("the zlib stream is truncated")
    return inflated
