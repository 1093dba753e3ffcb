"""The size of a compressed image, from its header: before anything is decoded."""

import io
import warnings

from PIL import Image, UnidentifiedImageError

#: Most pixels of an image: 8192 × 8192. Decoded, they are up to 512 MiB.
MAX_PIXELS = 1 << 26


class ImageSizeError(ValueError):
    """An image that is too large, or whose size is unknown."""


def check(content: bytes) -> None:
    """Checks the size of an image that is to be decoded.

    Args:
        content: PNG, TIFF, PGM, PPM, JPEG, WebP or BMP.

    Raises:
        ImageSizeError: more than `MAX_PIXELS`, or no image.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the library's own limit, which is larger
            with Image.open(io.BytesIO(content)) as image:
                width, height = image.size
    except Image.DecompressionBombError:
        raise ImageSizeError(f"more than the {MAX_PIXELS} pixels that are allowed") from None
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, EOFError, ArithmeticError) as error:
        raise ImageSizeError(f"no image with a known size: {type(error).__name__}") from error
    if width * height > MAX_PIXELS:
        raise ImageSizeError(f"{width} × {height} pixels, {MAX_PIXELS} are allowed")
