"""Frames from files of PCIC messages, written by ifm3d's frame grabber and its tests."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.files import limited
from drivers.contract.frame import Frame
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.o3r import tof_info
from drivers.o3r.chunks import Chunk, ChunkError, ChunkType, messages
from drivers.o3r.exposure import SENSOR, Exposure

#: Largest file, which is read as a whole [bytes].
MAX_BYTES = 1 << 32

#: Chunk of the images, by stream name.
_STREAMS: Mapping[str, ChunkType] = {
    "depth": ChunkType.DISTANCE,
    "deviation": ChunkType.DISTANCE_NOISE,
    "amplitude": ChunkType.NORMALIZED_AMPLITUDE,
    "confidence": ChunkType.CONFIDENCE,
}

_NEEDED = (ChunkType.DISTANCE, ChunkType.TOF_INFO)


class O3rBuffers:
    """A file of messages with radial distances, their deviations, amplitudes and confidences.

    Raises:
        ForeignRecordingError: unreadable or malformed file, or a message without distances or calibration.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._exposures = list(messages(limited.read(path, MAX_BYTES)))
            lacking = [kind.name for chunks in self._exposures for kind in _NEEDED if kind not in chunks]
            if lacking or not self._exposures:
                raise ChunkError(f"there is no chunk {lacking[0] if lacking else 'at all'}")
            camera = exposure(self._exposures[0]).camera
        except OSError as error:
            raise ForeignRecordingError(f"{path}: cannot be read: {error.strerror}") from error
        except ChunkError as error:
            raise ForeignRecordingError(f"{path}: {error}") from error
        self.cameras: Mapping[str, Camera] = {SENSOR: camera}
        self.total = sum(len(set(_STREAMS.values()) & chunks.keys()) for chunks in self._exposures)

    def frames(self) -> Iterator[Frame]:
        """All images; those of one exposure share sequence number and time."""
        try:
            for chunks in self._exposures:
                yield from exposure(chunks).frames(self.cameras[SENSOR].calib_id)
        except ChunkError as error:
            raise ForeignRecordingError(f"{self._path}: {error}") from error


def exposure(chunks: Mapping[int, Chunk]) -> Exposure:
    """Exposure of one message with distances and TOF_INFO.

    Raises:
        ChunkError: a malformed chunk.
    """
    distance, info = chunks[ChunkType.DISTANCE], tof_info.parse(bytes(chunks[ChunkType.TOF_INFO].content))
    images = {stream: chunks[kind].image() for stream, kind in _STREAMS.items() if kind in chunks}
    if "amplitude" in images:
        images["amplitude"] = _amplitudes(images["amplitude"], info.amplitude)
    return Exposure(distance.frame, distance.time_ns, info, images)


def _amplitudes(image: NDArray[Any], step: float) -> NDArray[np.float32]:
    """Amplitudes from digits, which are one more than their roots; 0 means none, which becomes -1. Source: ifm3d."""
    if not np.issubdtype(image.dtype, np.integer):
        return image
    root = image.astype(np.float32) - np.float32(1.0)
    return np.where(root >= 0, root * root * np.float32(step), np.float32(-1.0))
