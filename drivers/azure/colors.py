"""Colour images in the encodings of the Azure Kinect."""

from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.encoding import image_size


def color(encoding: str, content: bytes, camera: Camera) -> NDArray[np.generic]:
    """Colour image (height, width, 3), BGR.

    Raises:
        ValueError: another encoding, or another size than the camera's.
    """
    if encoding not in _DECODERS:
        raise ValueError(f"encoding {encoding!r} is none of {sorted(_DECODERS)}")
    try:
        image = _DECODERS[encoding](content, camera)
    except cv2.error as error:
        raise ValueError(f"no {encoding} image: {error}") from error
    if image.shape != (camera.height, camera.width, 3):
        raise ValueError(f"this is no {encoding} image of {camera.width} × {camera.height} pixels")
    return image


def _jpeg(content: bytes, camera: Camera) -> Any:
    return image_size.decoded(content, cv2.IMREAD_COLOR)


def _nv12(content: bytes, camera: Camera) -> Any:
    planes = np.frombuffer(content, np.uint8).reshape(camera.height * 3 // 2, camera.width)
    return cv2.cvtColor(planes, cv2.COLOR_YUV2BGR_NV12)


def _yuy2(content: bytes, camera: Camera) -> Any:
    pairs = np.frombuffer(content, np.uint8).reshape(camera.height, camera.width, 2)
    return cv2.cvtColor(pairs, cv2.COLOR_YUV2BGR_YUY2)


def _bgra(content: bytes, camera: Camera) -> Any:
    return np.ascontiguousarray(np.frombuffer(content, np.uint8).reshape(camera.height, camera.width, 4)[..., :3])


_DECODERS: Mapping[str, Callable[[bytes, Camera], Any]] = {"MJPG": _jpeg, "NV12": _nv12, "YUY2": _yuy2, "BGRA": _bgra}
