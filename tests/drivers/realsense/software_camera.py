"""A software device of librealsense, fed by a thread of the test."""

import threading
import time
from typing import Any

import numpy as np

from drivers.realsense import library
from tests.drivers.conformance.bench import Fault

SIZE = (64, 48)


class SoftwareCamera:
    """Depth, infra-red and confidence behind one lens and a separate colour camera, like an L515.

    Args:
        serial: its serial number.
        model: of its lenses.
        fault: what goes wrong.
        after: from which exposure on.
        separate: False if colours are a stream of the depth sensor, like a D405's.

    Attributes:
        device: `rs.software_device`.
        profiles: of its streams, by their kind.
    """

    def __init__(
        self,
        serial: str = "0001",
        model: str = "brown_conrady",
        fault: Fault = Fault.NONE,
        after: int = 0,
        *,
        separate: bool = True,
    ) -> None:
        self.rs = rs = library.load()
        self.fault = fault
        self._after = after
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.serial_number, serial)
        self.device.register_info(rs.camera_info.name, "software camera")
        self._depth = self.device.add_sensor("depth")
        self._color = self.device.add_sensor("colour") if separate else self._depth
        kinds = (
            (self._depth, "depth", "z16", 2, 1),
            (self._depth, "infrared", "y8", 1, 2),
            (self._depth, "confidence", "raw8", 1, 3),
            (self._color, "color", "rgb8", 3, 4),
        )
        self._streams = [
            (sensor, kind, bpp, sensor.add_video_stream(self._stream(kind, encoding, bpp, number, model)))
            for sensor, kind, encoding, bpp, number in kinds
        ]
        self.profiles = {kind: profile.as_video_stream_profile() for _, kind, _, profile in self._streams}
        extrinsics = rs.extrinsics()
        extrinsics.rotation = [0, 1, 0, -1, 0, 0, 0, 0, 1]  # column by column
        extrinsics.translation = [-0.05, 0.01, 0.02]
        self._streams[0][3].register_extrinsics_to(self._streams[3][3], extrinsics)
        self._depth.add_read_only_option(rs.option.depth_units, 0.0005)
        self._depth.add_option(rs.option.exposure, rs.option_range(), True)
        self._stop = threading.Event()
        self._thread = threading.Thread()

    def show(self, number: int, time_ms: float) -> None:
        """Emits one exposure: depth 1000 + number except in the first row."""
        rs, (width, height) = self.rs, SIZE
        fault = self.fault if number >= self._after else Fault.NONE
        if fault in {Fault.STALL, Fault.UNPLUG}:
            return
        for sensor, kind, bpp, _ in self._streams:
            depth = np.full((height, width), 1000 + number, np.uint16)
            depth[0 if fault != Fault.NAN else slice(None)] = 0
            images = {"depth": depth, "color": np.full((height, width, 3), number % 256, np.uint8)}
            frame = rs.software_video_frame()
            frame.pixels = images.get(kind, np.full((height, width), number % 256, np.uint8))
            frame.bpp, frame.stride = bpp, width * bpp
            if fault in {Fault.DROP, Fault.WRONG_SIZE} and number % 2:
                frame.stride = width * bpp // 2  # rows with half of their pixels
            frame.timestamp, frame.domain = time_ms, rs.timestamp_domain.hardware_clock
            frame.frame_number = number
            frame.profile = self.profiles[kind]
            if kind == "depth":
                frame.depth_units = 0.0005
            sensor.set_metadata(rs.frame_metadata_value.actual_exposure, 80)
            sensor.on_video_frame(frame)

    def run(self, rate_hz: float = 100.0) -> None:
        """Emits exposures until `halt`."""
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._show_all, args=(self._stop, 1 / rate_hz), name="shows", daemon=True
        )
        self._thread.start()

    def halt(self) -> None:
        """Stops the emission."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _show_all(self, stop: threading.Event, period_s: float) -> None:
        number = 0
        while not stop.wait(period_s):
            self.show(number, time.monotonic() * 1000 % 1e6)
            number += 1

    def _stream(self, kind: str, encoding: str, bpp: int, number: int, model: str) -> Any:
        rs = self.rs
        intrinsics = rs.intrinsics()
        intrinsics.width, intrinsics.height = SIZE
        intrinsics.ppx, intrinsics.ppy, intrinsics.fx, intrinsics.fy = 31.0, 24.0, 60.0, 61.0
        intrinsics.model, intrinsics.coeffs = getattr(rs.distortion, model), [0.1, -0.2, 0.001, 0.002, 0.01]
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid = getattr(rs.stream, kind), 0, number
        stream.width, stream.height, stream.fps, stream.bpp = *SIZE, 30, bpp
        stream.fmt, stream.intrinsics = getattr(rs.format, encoding), intrinsics
        return stream
