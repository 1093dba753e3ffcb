"""MKV files of the Azure Kinect: depth, amplitudes or infra-red, and colours. PyAV demuxes only."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.azure import calibration
from drivers.azure.calibration import CalibrationError
from drivers.azure.colors import color
from drivers.azure.picture import AMPLITUDE, COLOR, DEPTH, ENCODINGS, PASSIVE, Role
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError

#: Streams by the title of a track; infra-red without the camera's own light is no amplitude.
_TRACKS: Mapping[str, Role] = {"DEPTH": DEPTH, "IR": AMPLITUDE, "COLOR": COLOR}
_PASSIVE: Mapping[str, Role] = {**_TRACKS, "IR": PASSIVE}


class AzureRecording:
    """Images of one recording; depth in millimetres along z.

    Attributes:
        cameras: `depth` and `color`, as recorded; depth is the rig's frame.
        total: None: the number of images is unknown before reading.

    Raises:
        ForeignRecordingError: unreadable file, missing or unsupported calibration, or PyAV is not installed.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.total = None
        with _container(path) as file:
            titles = {stream.metadata.get("title") for stream in file.streams.video} & _TRACKS.keys()
            tags = {key: value for stream in file.streams for key, value in stream.metadata.items()} | file.metadata
            name = tags.get("K4A_CALIBRATION_FILE", "calibration.json")
            attached = {s.metadata.get("filename"): s.data for s in file.streams if s.type == "attachment"}
            self._start_ns = _wall_ns(tags.get("creation_time", ""))
            self._offset_us = int(tags.get("K4A_START_OFFSET_NS", "0")) // 1000
            self._tracks = _PASSIVE if tags.get("K4A_IR_MODE") == "PASSIVE" else _TRACKS
            self._serial = tags.get("K4A_DEVICE_SERIAL_NUMBER", "")
        if not titles or name not in attached:
            raise ForeignRecordingError(
                f"{path}: no recording of an Azure Kinect: it lacks {name if titles else 'every image'}"
            )
        self._color, _, color = tags.get("K4A_COLOR_MODE", "").partition("_")
        modes = {"color": color} if "COLOR" in titles else {}
        modes |= {"depth": tags.get("K4A_DEPTH_MODE", "PASSIVE_IR")} if titles & {"DEPTH", "IR"} else {}
        try:
            self.cameras: Mapping[str, Camera] = calibration.cameras(bytes(attached[name]), modes)
        except CalibrationError as error:
            raise ForeignRecordingError(f"{path}: {error}") from error

    def frames(self) -> Iterator[Frame]:
        """All images, with sequence numbers from their times: images of one capture share a number, losses are gaps."""
        with _container(self._path) as file:
            for packet in file.demux():
                role = self._tracks.get(packet.stream.metadata.get("title", ""))
                if role is None or packet.pts is None or not packet.size:
                    continue
                time_s = packet.pts * packet.time_base
                number = round(time_s * (packet.stream.average_rate or 0))
                yield self._frame(role, bytes(packet), round(time_s * 1_000_000), number)

    def _frame(self, role: Role, content: bytes, time_us: int, seq: int) -> Frame:
        camera, kind = self.cameras[role.sensor], role.kind
        t_ns = max(self._start_ns + time_us * 1000, 0)
        try:
            data = color(self._color, content, camera) if kind == Kind.COLOR else words(content, camera)
        except ValueError as error:
            raise ForeignRecordingError(f"{self._path}: {role.stream} at {time_us} µs: {error}") from error
        is_depth = kind == Kind.DEPTH
        return Frame(
            sensor=role.sensor,
            stream=role.stream,
            kind=kind,
            data=data,
            encoding=ENCODINGS[kind],
            t_host_ns=t_ns,
            t_arrival_ns=t_ns,
            seq=seq,
            scale=0.001 if is_depth else 1.0,
            geometry=Geometry.Z if is_depth else Geometry.NONE,
            invalid=0.0 if is_depth else None,
            t_device_ticks=time_us + self._offset_us,
            tick_hz=1e6,
            clock_domain=f"azure:{self._serial}",
            calib_id=camera.calib_id,
        )


def words(content: bytes, camera: Camera) -> NDArray[np.generic]:
    """Depth or infra-red: 16 bits per pixel, big-endian.

    Raises:
        ValueError: another number of pixels than the camera's.
    """
    if len(content) != 2 * camera.width * camera.height:
        raise ValueError(f"{camera.width} × {camera.height} pixels need two bytes each, there are {len(content)}")
    return np.frombuffer(content, ">u2").astype("<u2").reshape(camera.height, camera.width)


def _wall_ns(text: str) -> int:
    """Start of the recording [ns since the Unix epoch]; 0 if unknown."""
    try:
        began = datetime.fromisoformat(text)
    except ValueError:
        return 0
    began = began if began.tzinfo else began.replace(tzinfo=UTC)
    return math.floor(began.timestamp()) * 1_000_000_000


@contextmanager
def _container(path: Path) -> Iterator[Any]:
    """The open file; translates exceptions into errors that name the file and the remedy."""
    try:
        import av  # noqa: PLC0415  an extra
        import av.error  # noqa: PLC0415
    except ImportError as error:
        raise ForeignRecordingError(
            f"{path}: MKV is read by PyAV, which the extra `import` of abs-service installs"
        ) from error
    try:
        with av.open(str(path)) as file:
            yield file
    except (OSError, ValueError, av.error.FFmpegError) as error:
        raise ForeignRecordingError(f"{path}: cannot be read as MKV: {error}") from error
