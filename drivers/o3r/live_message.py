"""Exposures from messages of ifm3d's frame grabber."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.o3r import tof_info
from drivers.o3r.chunks import ChunkError
from drivers.o3r.exposure import Exposure

#: Name of ifm3d's buffer, by stream name.
_BUFFERS: Mapping[str, str] = {
    "depth": "RADIAL_DISTANCE_IMAGE",
    "deviation": "RADIAL_DISTANCE_NOISE",
    "amplitude": "NORM_AMPLITUDE_IMAGE",
    "confidence": "CONFIDENCE_IMAGE",
}
_LENGTHS = ("depth", "deviation")
_INFO = "TOF_INFO"


def wanted(ifm3d: Any) -> list[Any]:
    """Identifiers of the buffers that `decoded` needs."""
    return [getattr(ifm3d.buffer_id, name) for name in (*_BUFFERS.values(), _INFO)]


def decoded(ifm3d: Any, message: Any) -> Exposure:
    """Exposure of an `ifm3dpy.Frame`.

    Raises:
        ChunkError: no distances or no calibration, or a malformed calibration.
    """
    found = {stream: _buffer(ifm3d, message, name) for stream, name in _BUFFERS.items()}
    images = {stream: image for stream, image in found.items() if image is not None}
    content = _buffer(ifm3d, message, _INFO)
    if "depth" not in images or content is None:
        raise ChunkError("a message lacks distances or TOF_INFO")
    info = tof_info.parse(content.tobytes())
    digits = {stream: _digits(images[stream], info.distance_m) for stream in _LENGTHS if stream in images}
    time_us = round(message.timestamps()[0].timestamp() * 1e6)  # ifm3dpy has no nanoseconds
    return Exposure(message.frame_count(), time_us * 1000, info, images | digits)


def _digits(lengths: NDArray[Any], distance_m: float) -> NDArray[np.uint16]:
    """Digits as the head sent them: ifm3d multiplies them by the step [m]. Half the bytes, and nothing is lost."""
    return np.rint(lengths / np.float32(distance_m)).astype("<u2")


def _buffer(ifm3d: Any, message: Any, name: str) -> NDArray[Any] | None:
    identifier = getattr(ifm3d.buffer_id, name)
    return np.array(message.get_buffer(identifier)) if message.has_buffer(identifier) else None
