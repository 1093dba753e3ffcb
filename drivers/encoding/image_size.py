"""Decoding of compressed images, whose size, from their header, and completeness are checked before."""

import io
import warnings
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

#: Most pixels of an image: 8192 × 8192. Decoded, they are up to 512 MiB.
MAX_PIXELS = 1 << 26

#: First bytes of a PNG, and of a JPEG.
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"


class ImageSizeError(ValueError):
    """An image that is too large, or whose size is unknown, or that is not all there, or cannot be decoded."""


def is_cut_off(content: bytes) -> bool:
    """True for a PNG or JPEG whose end is missing: decoders make up what is."""
    if content.startswith(_PNG):
        return not _has_all_chunks(content)
    return content.startswith(_JPEG) and content.rfind(b"\xff\xd9") <= content.rfind(b"\xff\xda")


def _has_all_chunks(png: bytes) -> bool:
    """True if its chunks are as long as they say, up to the last: a decoder makes room for what a chunk announces."""
    begin = len(_PNG)
    while (end := begin + 8 + int.from_bytes(png[begin : begin + 4], "big")) <= len(png):
        if png[begin + 4 : begin + 8] == b"IEND":
            return True
        begin = end + 4  # behind the checksum
    return False


def check(content: bytes) -> tuple[int, int]:
    """Checks the size of an image that is to be decoded.

    Args:
        content: PNG, TIFF, PGM, PPM, JPEG, WebP or BMP.

    Returns:
        Width and height [px].

    Raises:
        ImageSizeError: more than `MAX_PIXELS`, a PNG that announces more bytes than it has, or no image.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the library's own limit, which is larger
            with Image.open(io.BytesIO(content)) as image:
                width, height = image.size
    except Image.DecompressionBombError:
        raise ImageSizeError(f"more than the {MAX_PIXELS} pixels that are allowed") from None
    except UnidentifiedImageError:
        raise ImageSizeError("no image of a known format" if content else "it is empty") from None
    except (OSError, ValueError, SyntaxError, EOFError, ArithmeticError) as error:
        raise ImageSizeError(f"no image with a known size: {type(error).__name__}") from error
    if width * height > MAX_PIXELS:
        raise ImageSizeError(f"{width} × {height} pixels, {MAX_PIXELS} are allowed")
    if content.startswith(_PNG) and not _has_all_chunks(content):
        raise ImageSizeError("a part of it is missing")
    return width, height


def decoded(content: bytes, flags: int) -> NDArray[Any]:
    """The pixels that `cv2.imdecode` makes with these flags of an image of a size that is allowed.

    Raises:
        ImageSizeError: as `check`, or it cannot be decoded.
    """
    check(content)
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:  # a check of OpenCV's own
        image = None
    if image is None:
        raise ImageSizeError("it cannot be decoded")
    return image
