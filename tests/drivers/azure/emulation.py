"""Azure Kinects for tests: the functions `k4a_device_*` are emulated, everything else is Microsoft's library."""

import operator
import threading
import time
from ctypes import c_void_p
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from drivers.azure.address import FORMATS, RATES_HZ
from drivers.azure.calibration import COLOR_MODES, DEPTH_MODES
from tests.drivers.azure.captures import Maker, noisy
from tests.drivers.conformance.bench import BEFORE, Fault
from tests.waiting import eventually

FAILED, TIMEOUT = 1, 2
#: The device's time of the first exposure [µs].
BEGIN_US = 5_000_000
#: What a reference made by `ctypes.byref` leads to.
of = operator.attrgetter("_obj")


@dataclass
class EmulatedKinect:
    """One camera.

    Attributes:
        serial: its number; "" for one that another program has opened.
        calibration: its JSON.
        fault, after: what goes wrong after so many captures.
        silent: loses the depth images (`depth`) or the colours (`color`) of some exposures, by number.
        controls: mode and value by command.
        started: configurations of all starts.
    """

    serial: str
    calibration: bytes
    fault: Fault = Fault.NONE
    after: int = BEFORE + 2
    silent: dict[int, str] = field(default_factory=dict)
    controls: dict[int, tuple[int, int]] = field(
        default_factory=lambda: {0: (0, 16670), 6: (0, 4500), 8: (1, 128), 9: (1, 2)}
    )
    started: list[Any] = field(default_factory=list)
    open: bool = False
    streams: bool = False
    number: int = 0
    begin_s: float = 0.0
    changed: threading.Condition = field(default_factory=threading.Condition)


#: Exposures by the SDK's number of the mains (src/color/color_priv.h); it takes the first that is not shorter.
EXPOSURES_US = {
    1: (500, 1250, 2500, 10000, 20000, 30000, 40000, 50000, 60000, 80000, 100000, 120000, 130000),
    2: (500, 1250, 2500, 8330, 16670, 33330, 41670, 50000, 66670, 83330, 100000, 116670, 133330),
}
#: Minimum, maximum and step of the controls.
LIMITS = {0: (500, 133330, 100), 6: (2500, 12500, 10), 8: (0, 255, 1), 9: (1, 2, 1)}


class EmulatedSdk:
    """The library with emulated cameras."""

    def __init__(self, sdk: Any, *cameras: EmulatedKinect) -> None:
        self.sdk, self.cameras, self.maker = sdk, cameras, Maker(sdk)
        self.jpeg = cv2.imencode(".jpg", np.full((720, 1280, 3), (200, 100, 50), np.uint8))[1].tobytes()

    def __getattr__(self, name: str) -> Any:
        assert not name.startswith("k4a_device"), f"{name} is not emulated"
        return getattr(self.sdk, name)

    def k4a_device_get_installed_count(self) -> int:
        return len(self.cameras)

    def k4a_device_open(self, number: int, handle: Any) -> int:
        camera = self.cameras[number]
        if camera.open or not camera.serial:
            return FAILED
        camera.open = True
        of(handle).value = number + 1
        return 0

    def k4a_device_close(self, handle: c_void_p) -> None:
        assert self._of(handle).open
        self._of(handle).open = False

    def k4a_device_get_serialnum(self, handle: c_void_p, text: Any, size: Any) -> int:
        return self._text(self._of(handle).serial.encode() + b"\0", text, size)

    def k4a_device_get_raw_calibration(self, handle: c_void_p, text: Any, size: Any) -> int:
        return self._text(self._of(handle).calibration, text, size)

    def k4a_device_get_version(self, handle: c_void_p, versions: Any) -> int:
        of(versions).numbers[:] = [1, 6, 110, 1, 6, 80, 1, 6, 14, 6109, 7, 0]
        return 0

    def k4a_device_get_color_control(self, handle: c_void_p, command: int, mode: Any, value: Any) -> int:
        of(mode).value, of(value).value = self._of(handle).controls[command]
        return 0

    def k4a_device_set_color_control(self, handle: c_void_p, command: int, mode: int, value: int) -> int:
        minimum, maximum, step = LIMITS[command]
        if not minimum <= value <= maximum or (command and (value - minimum) % step):
            return FAILED
        if command == 0:
            value = next(longer for longer in EXPOSURES_US[self._of(handle).controls[9][1]] if value <= longer)
        self._of(handle).controls[command] = mode, value
        return 0

    def k4a_device_get_color_control_capabilities(
        self, handle: c_void_p, command: int, auto: Any, *numbers: Any
    ) -> int:
        for reference, value in zip(numbers, LIMITS[command], strict=False):
            of(reference).value = value
        return 0

    def k4a_device_start_cameras(self, handle: c_void_p, configuration: Any) -> int:
        camera = self._of(handle)
        if camera.streams:
            return FAILED
        camera.started.append(type(of(configuration)).from_buffer_copy(of(configuration)))
        camera.streams, camera.number, camera.begin_s = True, 0, time.monotonic()
        return 0

    def k4a_device_stop_cameras(self, handle: c_void_p) -> None:
        camera = self._of(handle)
        with camera.changed:
            camera.streams = False
            camera.changed.notify_all()
        # The SDK waits, for ever, until all images are released.
        assert eventually(lambda: not self.maker.held or any(one.streams for one in self.cameras))

    def k4a_device_get_capture(self, handle: c_void_p, capture: Any, timeout_ms: int) -> int:
        camera, end_s = self._of(handle), time.monotonic() + timeout_ms / 1000
        broken = camera.number >= camera.after
        if broken and camera.fault == Fault.UNPLUG:
            return FAILED
        hertz = RATES_HZ[camera.started[-1].camera_fps]
        due_s = np.inf if broken and camera.fault == Fault.STALL else camera.begin_s + camera.number / hertz
        with camera.changed:
            camera.changed.wait_for(lambda: not camera.streams, max(min(due_s, end_s) - time.monotonic(), 0))
            if not camera.streams:
                return FAILED
        if due_s > end_s:
            return TIMEOUT
        of(capture).value = self.exposure(camera, camera.number, hertz).value
        camera.number += 2 if broken and camera.fault == Fault.DROP else 1
        return 0

    def exposure(self, camera: EmulatedKinect, number: int, hertz: int) -> c_void_p:
        made, wanted = self.maker.capture(), camera.started[-1]
        time_us, odd = BEGIN_US + number * 1_000_000 // hertz, number >= camera.after and number % 2
        lost = camera.silent.get(number, "")
        if wanted.depth_mode and lost != "depth":
            size = [*DEPTH_MODES.values()][wanted.depth_mode - 1].size
            depth = noisy(number, size if not (odd and camera.fault == Fault.WRONG_SIZE) else (size[0], size[1] // 2))
            depth[0 if not (odd and camera.fault == Fault.NAN) else slice(None)] = 0
            if wanted.depth_mode < 5:
                self.maker.add(made, "depth", 4, depth.shape[::-1], depth.tobytes(), time_us)
            self.maker.add(made, "ir", 5, size, noisy(number + 7, size).tobytes(), time_us)
        if wanted.color_resolution and lost != "color":
            size = [*COLOR_MODES.values()][wanted.color_resolution - 1].size
            content = self._colors(wanted.color_format, size, number)
            self.maker.add(made, "color", wanted.color_format, size, content, time_us + 20, 8330)
        return made

    def _colors(self, form: int, size: tuple[int, int], number: int) -> bytes:
        if FORMATS[form] == "MJPG":
            return self.jpeg + number.to_bytes(4, "little")  # bytes behind the image's end: no two are alike
        bytes_of = {"NV12": 3 / 2, "YUY2": 2, "BGRA": 4}[FORMATS[form]]
        return bytes([number % 256]) * round(size[0] * size[1] * bytes_of)

    def _of(self, handle: c_void_p) -> EmulatedKinect:
        return self.cameras[(handle.value or 0) - 1]

    @staticmethod
    def _text(content: bytes, text: Any, size: Any) -> int:
        known, of(size).value = of(size).value, len(content)
        if text is None or known < len(content):
            return TIMEOUT  # K4A_BUFFER_RESULT_TOO_SMALL has the same number
        text[: len(content)] = content
        return 0
