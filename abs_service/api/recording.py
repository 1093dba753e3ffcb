"""A recording as arrays, read only as far as it is looked at."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service import config
from abs_service.api import checks
from abs_service.api.checks import ArgumentError
from abs_service.api.estimate import Estimate
from abs_service.api.recorded_estimates import estimates, trackers
from abs_service.api.rig import Rig, configured_rig
from calib.camera import Camera
from drivers import replay
from drivers.contract.frame import Frame
from drivers.replay.contents import scan


@dataclass(frozen=True, eq=False)
class Image:
    """One recorded image.

    Attributes:
        stream: "sensor/stream": `tof/depth`, `tof/amplitude`, `color/color`.
        time_s: moment of the exposure [s], from the same origin as that of the estimates.
        seq: number of the exposure; gaps are losses.
        values: depth (height, width) [m], NaN without return; colour (height, width, 3) red, green, blue, uint8; mosaic
            (height, width), uint8; others (height, width) in the sensor's unit, float32.
        geometry: of a depth image, "z" or "radial"; "none" for others.
    """

    stream: str
    time_s: float
    seq: int
    values: NDArray[Any]
    geometry: str


class Recording:
    """An MCAP file that abs-service wrote; `open_recording` opens one.

    Attributes:
        path: of the file.
        duration_s: from the first to the last message [s].
        truncated: True if the file was never finished; its complete part can be read.
        trackers: names of the trackers with estimates in it.
    """

    def __init__(self, path: str | Path):
        self.path = checks.path(path)
        self._contents = scan(self.path)
        self.duration_s = (self._contents.end_ns - self._contents.start_ns) * 1e-9
        self.truncated = self._contents.truncated
        self.trackers = trackers(self._contents)

    @property
    def streams(self) -> Mapping[str, int]:
        """Number of images by "sensor/stream".

        Raises:
            RecordingError: there are no images in the file.
        """
        return {f"{sensor}/{stream}": count for (sensor, stream), count in self._images.counts.items()}

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Cameras by sensor, as they were used during the recording.

        Raises:
            RecordingError: there are no images in the file.
        """
        return self._images.cameras

    @property
    def rig(self) -> Rig:
        """The rig that was recorded, with its cameras: `recording.rig.tracker("sheet")`.

        Raises:
            ConfigError: no configuration is in the file, or one that cannot be used any more.
        """
        toml = self._contents.attachments.get("rig.toml", b"").decode("utf-8", "replace")
        if not toml:
            raise config.ConfigError(f"{self.path}: no configuration is in this recording")
        settings = config.loads(toml, f"{self.path} (rig.toml)", self.path.resolve().parent)
        return configured_rig(settings, self.cameras)

    def images(self, *streams: str) -> Iterator[Image]:
        """Images in the order of their times.

        Args:
            streams: which ones, as "sensor/stream"; all if none is named.

        Raises:
            ArgumentError: no such stream.
            RecordingError: there are no images in the file, or a part of it is damaged.
        """
        for stream in streams:
            if stream not in self.streams:
                raise ArgumentError(
                    f"streams = {stream!r}: must be in {self.path}, which has {', '.join(self.streams)}"
                )
        wanted = {(sensor, name) for sensor, _, name in (stream.partition("/") for stream in streams)}
        return map(_image, self._images.images(wanted))

    def estimates(self, tracker: str = "") -> Iterator[Estimate]:
        """Estimates that were recorded, or that `abs-service replay` wrote, in the order of their times.

        Args:
            tracker: whose; "" if there is only one.

        Raises:
            ArgumentError: no such tracker, or several.
            RecordingError: a part of the file is damaged.
        """
        if not tracker and len(self.trackers) == 1:
            tracker = self.trackers[0]
        if not self.trackers:
            raise ArgumentError(f"tracker = {tracker!r}: {self.path} has no estimates; `abs-service replay` makes them")
        if tracker not in self.trackers:
            raise ArgumentError(f"tracker = {tracker!r}: must be in {self.path}, which has {', '.join(self.trackers)}")
        return estimates(self.path, self._contents, tracker)

    @cached_property
    def _images(self) -> replay.Recording:
        return replay.Recording(self.path, self._contents)


def open_recording(path: str | Path) -> Recording:
    """Opens a recording; nothing but its index is read before it is asked for.

    Raises:
        ArgumentError: no path.
        RecordingError: no such file, or no MCAP file.
    """
    return Recording(path)


def _image(frame: Frame) -> Image:
    if frame.encoding in ("rgb8", "bgr8"):
        values = np.asarray(frame.data)[..., :: 1 if frame.encoding == "rgb8" else -1]
    else:
        values = np.asarray(frame.data) if frame.encoding.startswith("bayer") else frame.si()
    stream = f"{frame.sensor}/{frame.stream}"
    return Image(stream, frame.t_host_ns * 1e-9, frame.seq, values, frame.geometry.value)
