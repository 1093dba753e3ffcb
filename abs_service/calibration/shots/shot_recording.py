"""Recording of shots in the format of all recordings."""

from collections.abc import Mapping
from pathlib import Path

from abs_service.bus.stamps import HeaderFactory
from abs_service.calibration.shots.shots import Shot
from abs_service.capture.mcap_writing import write_cameras, write_frame
from calib.camera import Camera
from drivers.encoding.mcap_file import McapFile


class ShotFileError(Exception):
    """Recording of shots that cannot be written; names the file."""


class ShotRecording:
    """Recording of the frames of shots, each with the preceding frame set.

    Args:
        path: file to write; must not exist.
        headers: creates message headers.
        cameras: of all sensors, by name.
        rig_toml: configuration to attach.

    Raises:
        ShotFileError: the file exists, or cannot be written.
    """

    def __init__(self, path: Path, headers: HeaderFactory, cameras: Mapping[str, Camera], rig_toml: str) -> None:
        self._path = path
        self._headers = headers
        self._is_empty = True
        try:
            self._stream = path.open("xb")
        except FileExistsError:
            raise ShotFileError(f"{path}: exists already; remove it or choose another name") from None
        except OSError as error:
            raise ShotFileError(f"{path}: cannot be written: {error.strerror}") from error
        self._file = McapFile(self._stream)
        now_ns = headers.clock.wall(headers.clock.monotonic())
        self._file.attach("rig.toml", "text/toml", rig_toml.encode(), now_ns)
        write_cameras(self._file, headers.now(0), cameras, now_ns)

    def write(self, shot: Shot) -> None:
        """Appends a shot and flushes it to disk.

        Raises:
            ShotFileError: the disk is full or unavailable.
        """
        try:
            for frame in sorted(shot.frames, key=lambda frame: frame.t_host_ns):
                wall_ns = self._headers.clock.wall(frame.t_host_ns)
                write_frame(self._file, frame, self._headers.at(frame.t_host_ns, frame.seq), wall_ns)
            self._file.flush()
            self._is_empty = False
        except OSError as error:
            raise ShotFileError(f"{self._path}: cannot be written: {error.strerror}") from error

    def finish(self) -> None:
        """Closes the file; one without a shot is removed.

        Raises:
            ShotFileError: the disk is full or unavailable.
        """
        try:
            self._file.finish()
        except OSError as error:
            raise ShotFileError(f"{self._path}: cannot be written: {error.strerror}") from error
        finally:
            self._stream.close()
            if self._is_empty:
                self._path.unlink(missing_ok=True)
