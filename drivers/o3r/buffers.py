"""Frames from files of PCIC messages, written by ifm3d's frame grabber and its tests."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from calib.camera import Camera
from calib.files import limited
from drivers.contract.frame import ENCODINGS, Frame, Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.o3r import tof_info
from drivers.o3r.chunks import Chunk, ChunkError, ChunkType, messages
from drivers.o3r.tof_info import TofInfo

#: Largest file, which is read as a whole [bytes].
LARGEST = 1 << 32

#: Name of the only sensor.
SENSOR = "depth"

#: Kind and chunk of the other images, by stream name.
_STREAMS: Mapping[str, tuple[Kind, ChunkType]] = {
    "deviation": (Kind.DEVIATION, ChunkType.DISTANCE_NOISE),
    "amplitude": (Kind.AMPLITUDE, ChunkType.NORMALIZED_AMPLITUDE),
    "confidence": (Kind.CONFIDENCE, ChunkType.CONFIDENCE),
}

_NEEDED = (ChunkType.DISTANCE, ChunkType.TOF_INFO)


class O3rBuffers:
    """A file of messages with radial distances, their deviations, amplitudes and confidences.

    Args:
        path: of the file.

    Attributes:
        cameras: the only sensor's, by its name.
        total: number of frames.

    Raises:
        ForeignRecordingError: unreadable or malformed file, or a message without distances or calibration.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._exposures = list(messages(limited.read(path, LARGEST)))
            lacking = [kind.name for chunks in self._exposures for kind in _NEEDED if kind not in chunks]
            if lacking or not self._exposures:
                raise ChunkError(f"there is no chunk {lacking[0] if lacking else 'at all'}")
            first = self._exposures[0]
            distance = first[ChunkType.DISTANCE]
            camera = _info(first).camera(distance.width, distance.height)
        except OSError as error:
            raise ForeignRecordingError(f"{path}: cannot be read: {error.strerror}") from error
        except ChunkError as error:
            raise ForeignRecordingError(f"{path}: {error}") from error
        self.cameras: Mapping[str, Camera] = {SENSOR: camera}
        images = {ChunkType.DISTANCE, *(chunk for _, chunk in _STREAMS.values())}
        self.total = sum(len(images & chunks.keys()) for chunks in self._exposures)

    def frames(self) -> Iterator[Frame]:
        """All images; those of one exposure share sequence number and time."""
        try:
            for chunks in self._exposures:
                yield from exposure(chunks, self.cameras[SENSOR].calib_id)
        except ChunkError as error:
            raise ForeignRecordingError(f"{self._path}: {error}") from error


def exposure(chunks: Mapping[int, Chunk], calib_id: str) -> Iterator[Frame]:
    """Frames of one message with distances and TOF_INFO.

    Raises:
        ChunkError: a malformed chunk.
    """
    info = _info(chunks)
    yield _frame(chunks[ChunkType.DISTANCE], "depth", Kind.DEPTH, info, calib_id)
    for stream, (kind, chunk) in _STREAMS.items():
        if chunk in chunks:
            yield _frame(chunks[chunk], stream, kind, info, calib_id)


def _info(chunks: Mapping[int, Chunk]) -> TofInfo:
    return tof_info.parse(bytes(chunks[ChunkType.TOF_INFO].content))


def _frame(chunk: Chunk, stream: str, kind: Kind, info: TofInfo, calib_id: str) -> Frame:
    encodings = ("16UC1", "32FC1") if kind != Kind.CONFIDENCE else ("mono8", "mono16")
    image = chunk.image()
    encoding = next((name for name in encodings if ENCODINGS[name][0] == image.dtype), "")
    if not encoding:
        raise ChunkError(f"chunk {chunk.type}: {stream} must be one of {encodings}, not {image.dtype}")
    is_length, digits = kind in {Kind.DEPTH, Kind.DEVIATION}, np.issubdtype(image.dtype, np.integer)
    scale = {Kind.DEPTH: info.distance_m, Kind.DEVIATION: info.distance_m, Kind.AMPLITUDE: info.amplitude}
    return Frame(
        sensor=SENSOR,
        stream=stream,
        kind=kind,
        data=image,
        encoding=encoding,
        t_host_ns=chunk.time_ns,
        t_arrival_ns=chunk.time_ns,
        seq=chunk.frame,
        scale=scale.get(kind, 1.0) if digits else 1.0,
        geometry=Geometry.RADIAL if kind == Kind.DEPTH else Geometry.NONE,
        invalid=0.0 if is_length else None,
        t_device_ticks=chunk.time_ns,
        tick_hz=1e9,
        clock_domain="o3r",
        exposure_s=info.exposure_s,
        temperature_c=info.temperature_c,
        calib_id=calib_id,
    )
