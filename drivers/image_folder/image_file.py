"""Reading of one image file, which has to be whole."""

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.files import limited
from drivers.encoding import image_size
from drivers.image_folder.listing import ImageFolderError

#: Largest file [bytes].
MAX_BYTES = 1 << 28
#: Formats that can be read, for messages.
READABLE = "PNG, TIFF, PGM, PPM, JPEG, WebP, BMP and NPY"
#: Beginning of an array that NumPy has saved.
_NPY = b"\x93NUMPY"
#: Number of dimensions of an image with one channel.
_HEIGHT_AND_WIDTH = 2
#: Beginning of the text that stands in for a file of a repository with Git Large File Storage.
_POINTER = b"version https://git-lfs.github.com/spec/"


def read(path: Path) -> NDArray[Any]:
    """The pixels as the file has them, (height, width) or (height, width, channels) in OpenCV's order, not turned.

    Raises:
        ImageFolderError: it is no image, or a part of it is missing; names the file.
    """
    try:
        content = limited.read(path, MAX_BYTES)
    except OSError as error:
        raise ImageFolderError(f"{path}: cannot be read: {error.strerror}") from error
    if content.startswith(_POINTER):
        raise ImageFolderError(f"{path}: is a pointer of Git LFS, not the image itself; fetch it with: git lfs pull")
    if content.startswith(_NPY):
        return _array(path, content)
    if image_size.is_cut_off(content):
        raise ImageFolderError(f"{path}: the image is truncated: its end is missing")
    try:
        return image_size.decoded(content, cv2.IMREAD_UNCHANGED)
    except image_size.ImageSizeError as error:
        raise ImageFolderError(f"{path}: cannot be read as an image, {error}; {READABLE} can") from error


def _array(path: Path, content: bytes) -> NDArray[Any]:
    """The array in a file of NumPy: one image with one channel, as the order of several is unknown."""
    try:
        image = np.load(io.BytesIO(content), allow_pickle=False)
    except Exception as error:  # of a damaged header, whatever Python's tokenizer and parser raise
        raise ImageFolderError(f"{path}: cannot be read as an array of NumPy: {type(error).__name__}") from error
    if image.ndim != _HEIGHT_AND_WIDTH or not image.size:
        raise ImageFolderError(
            f"{path}: an image has the shape (height, width), this is {image.shape}; save each one in a file of its own"
        )
    return image
