"""Recordings of BundleFusion and ScanNet: depth and colour. No more than one image at a time is in memory."""

import heapq
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from calib import pose
from calib.camera import Camera
from calib.files import limited
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.sens import header as header_of
from drivers.sens import images
from drivers.sens.header import ImageHeader, SensError
from drivers.sens.places import FramePlaces, places
from drivers.sens.stamps import Stamps, Times

#: Default rate of a file without time stamps [Hz].
RATE_HZ = 30.0


class SensRecording:
    """Images of one file; depth along z in the file's unit. Poses of the camera in the scene are left out.

    Args:
        path: of the file.
        wanted: tells by its number, counted from 0, whether a frame is read.
        rate_hz: frames per second instead of the time stamps in the file; None for these.

    Attributes:
        cameras: `depth`, which is the rig's frame, and `color` if there are colours.
        total: number of images.
        time_problem: what is wrong with the time stamps and what is taken for them; "" if nothing is.

    Raises:
        ForeignRecordingError: unreadable or damaged file, none of the frames wanted, or images or a camera that are
            not supported.
    """

    def __init__(
        self, path: Path, wanted: Callable[[int], bool] = lambda number: True, rate_hz: float | None = None
    ) -> None:
        self._path, self._wanted = path, wanted
        with self._opened() as stream:
            self._header = header = header_of.read(stream)
            counts, stamps = self._scanned(stream)
            self._parts = {part.name: part for part in (header.depth, header.color) if counts[part.name]}
            self._times = stamps.times(self._parts, RATE_HZ) if rate_hz is None else Times({}, rate_hz)
            self.cameras: Mapping[str, Camera] = self._cameras()
        self.total = sum(counts.values())
        self.time_problem = self._times.problem

    def frames(self) -> Iterator[Frame]:
        """All images in order of time; of one moment, depth comes first."""
        with self._opened() as stream:
            ordered = heapq.merge(*(self._timed(stream, part) for part in self._parts.values()), key=lambda one: one[0])
            for t_ns, frame, part in ordered:
                place = frame.images[part.name]
                stream.seek(place.offset)
                content = stream.read(place.size)
                try:
                    yield self._frame(frame, part, t_ns, content)
                except SensError as error:
                    raise SensError(f"{part.name} of frame {frame.number}: {error}") from error

    def _scanned(self, stream: BinaryIO) -> tuple[dict[str, int], Stamps]:
        """Number of images by kind, and their time stamps, by the heads of all frames that are wanted."""
        counts, stamps, frame = {"depth": 0, "color": 0}, Stamps(), None
        for frame in self._places(stream):
            stamps.add(frame)
            for name, place in frame.images.items():
                counts[name] += place.size > 0
        if frame is None:
            raise SensError(f"it has none of the frames that were asked for; there are 0 to {self._header.count - 1}")
        if not counts["depth"]:
            raise SensError("depth_size_bytes = 0 in every frame: there is no depth image")
        return counts, stamps

    def _places(self, stream: BinaryIO) -> Iterator[FramePlaces]:
        """The frames that are wanted. Damage behind the last of them does no harm."""
        following = 0
        try:
            for frame in places(stream, self._header):
                following = frame.number + 1
                if self._wanted(frame.number):
                    yield frame
        except SensError:
            if any(map(self._wanted, range(following, self._header.count))):
                raise

    def _timed(self, stream: BinaryIO, part: ImageHeader) -> Iterator[tuple[int, FramePlaces, ImageHeader]]:
        """Time [ns], frame and header of every image of one kind."""
        for frame in self._places(stream):
            if frame.images[part.name].size:
                yield self._times.time_ns(frame, part.name), frame, part

    def _cameras(self) -> dict[str, Camera]:
        for part in self._parts.values():
            images.check_compression(part)
        T_rb = pose.inverse(self._header.depth.T_bs())
        cameras = {"depth": self._header.depth.camera(pose.identity())}
        if "color" in self._parts:
            color = self._header.color
            cameras["color"] = color.camera(T_rb @ color.T_bs())
        return cameras

    def _frame(self, frame: FramePlaces, part: ImageHeader, t_ns: int, content: bytes) -> Frame:
        is_depth, ticks = part.name == "depth", self._times.ticks(frame, part.name)
        encoding, data = ("16UC1", images.depth(part, content)) if is_depth else images.color(part, content)
        return Frame(
            sensor=part.name,
            stream=part.name,
            kind=Kind.DEPTH if is_depth else Kind.COLOR,
            data=data,
            encoding=encoding,
            t_host_ns=t_ns,
            t_arrival_ns=t_ns,
            seq=frame.number,
            scale=self._header.depth_scale if is_depth else 1.0,
            geometry=Geometry.Z if is_depth else Geometry.NONE,
            invalid=0.0 if is_depth else None,
            t_device_ticks=ticks or 0,
            tick_hz=0.0 if ticks is None else 1e6,
            clock_domain="file" if ticks is None else "sens",
            calib_id=self.cameras[part.name].calib_id,
        )

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        try:
            with limited.opened(self._path) as stream:
                yield stream
        except SensError as error:
            raise ForeignRecordingError(f"{self._path}: {error}") from error
        except OSError as error:
            raise ForeignRecordingError(f"{self._path}: cannot be read: {error.strerror}") from error
