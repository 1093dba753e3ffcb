"""Pixels of ROS images: sensor_msgs/Image, and sensor_msgs/CompressedImage of `image_transport`."""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.contract.frame import ENCODINGS, Kind
from drivers.encoding import image_size
from drivers.encoding.parsing import CodecError, unpadded

#: ROS encodings: the frame's encoding, and its kind. Depth is in millimetres (16UC1) or metres (32FC1), see REP 118.
_ENCODINGS: Mapping[str, tuple[str, Kind]] = {
    "16UC1": ("16UC1", Kind.DEPTH),
    "32FC1": ("32FC1", Kind.DEPTH),
    "mono8": ("mono8", Kind.IR),
    "8UC1": ("mono8", Kind.IR),
    "mono16": ("mono16", Kind.IR),
    "rgb8": ("rgb8", Kind.COLOR),
    "bgr8": ("bgr8", Kind.COLOR),
    "8UC3": ("bgr8", Kind.COLOR),
    **{name: (name, Kind.BAYER) for name in ENCODINGS if name.startswith("bayer_")},
}

#: Bytes before the PNG of a compressed depth image (compressed_depth_image_transport).
_DEPTH_HEADER = 12


class ImageError(ValueError):
    """An unusable image; names the problem."""


def is_image(message_type: str) -> bool:
    """True for the types of messages that `decode` takes."""
    return message_type in {"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"}


def decode(message: Any) -> tuple[Kind, str, NDArray[np.generic]]:
    """Kind, encoding and pixels of an image.

    Raises:
        ImageError: an encoding that is not supported, or too few bytes.
    """
    return _compressed(message) if hasattr(message, "format") else _raw(message)


def _raw(message: Any) -> tuple[Kind, str, NDArray[np.generic]]:
    if message.encoding not in _ENCODINGS or message.is_bigendian:
        raise ImageError(f"the encoding {message.encoding!r} is none of {sorted(_ENCODINGS)}, little-endian")
    encoding, kind = _ENCODINGS[message.encoding]
    try:
        return kind, encoding, unpadded(message.data, encoding, message.width, message.height, message.step)
    except CodecError as error:
        raise ImageError(str(error)) from error


def _compressed(message: Any) -> tuple[Kind, str, NDArray[np.generic]]:
    content = np.asarray(message.data, np.uint8).tobytes()
    is_depth = "compressedDepth" in message.format
    if is_depth and (not message.format.startswith("16UC1") or "rvl" in message.format):
        raise ImageError(f"the format {message.format!r} is no 16UC1 as PNG")
    flags = cv2.IMREAD_UNCHANGED if is_depth else cv2.IMREAD_COLOR
    try:
        image = image_size.decoded(content[_DEPTH_HEADER:] if is_depth else content, flags)
    except image_size.ImageSizeError as error:
        raise ImageError(f"an image of the format {message.format!r}: {error}") from error
    if is_depth and (image.dtype != np.uint16 or image.ndim != 2):
        raise ImageError(f"an image of the format {message.format!r} cannot be decoded")
    return (Kind.DEPTH, "16UC1", image) if is_depth else (Kind.COLOR, "bgr8", image)
