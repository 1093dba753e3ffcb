"""An open Azure Kinect: the SDK's handle, and the calls that need it."""

import ctypes
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from drivers.azure import library
from drivers.azure.library import Configuration, Versions
from drivers.contract.device import DeviceError

#: Results of the SDK's functions, and a buffer that is too small, which tells its size.
_SUCCEEDED, _TIMEOUT, _TOO_SMALL = 0, 2, 2
#: The depth engine computes with OpenGL, which most of its errors are about.
_ENGINE, _ENGINE_REMEDY = "engine create and initialize failed", "it needs OpenGL 4.4 in an X session: is DISPLAY set?"


@dataclass(frozen=True, slots=True)
class Limits:
    """Range of a control of the colour camera, in the SDK's units."""

    minimum: int
    maximum: int
    step: int


class Kinect:
    """An open camera."""

    def __init__(self, sdk: Any, handle: ctypes.c_void_p, uri: str) -> None:
        self.sdk = sdk
        self.uri = uri
        self._handle: ctypes.c_void_p | None = handle
        self._streams = False
        self._calls = threading.RLock()  # of all functions but `capture`, which waits
        self._captures = threading.Lock()

    def serial(self) -> str:
        """Serial number."""
        return self._buffer(self.sdk.k4a_device_get_serialnum).decode("ascii", "replace")

    def calibration(self) -> bytes:
        """The factory calibration: JSON."""
        return self._buffer(self.sdk.k4a_device_get_raw_calibration)

    def firmware(self) -> str:
        """Versions of the firmware of colours and depth."""
        versions = Versions()
        self._call(self.sdk.k4a_device_get_version, ctypes.byref(versions))
        color, depth = (".".join(map(str, versions.numbers[at : at + 3])) for at in (0, 3))
        return f"colour {color}, depth {depth}"

    def start(self, configuration: Configuration) -> None:
        """Starts the streams; ends those that ended by themselves."""
        with self._calls:
            self.stop()
            self._call(self.sdk.k4a_device_start_cameras, ctypes.byref(configuration))
            self._streams = True

    def stop(self) -> None:
        """Stops the streams; a `capture` that waits fails. The SDK waits here for images that somebody holds."""
        with self._calls:
            if self._streams and self._handle is not None:
                self.sdk.k4a_device_stop_cameras(self._handle)
            self._streams = False

    def capture(self, timeout_ms: int) -> ctypes.c_void_p | None:
        """The next capture, to be released by the caller; None after the timeout.

        Raises:
            DeviceError: the streams have ended.
        """
        capture = ctypes.c_void_p()
        with self._captures:
            result = self.sdk.k4a_device_get_capture(self._open(), ctypes.byref(capture), timeout_ms)
        if result == _TIMEOUT:
            return None
        if result != _SUCCEEDED:
            raise DeviceError(f"{self.uri}: the camera has ended its streams, or is gone: {library.reason()}")
        return capture

    def limits(self, command: int) -> Limits:
        """Range of a control."""
        auto, mode = ctypes.c_bool(), ctypes.c_int()
        numbers = [ctypes.c_int32() for _ in range(4)]  # minimum, maximum, step, default
        references = [ctypes.byref(one) for one in (auto, *numbers, mode)]
        self._call(self.sdk.k4a_device_get_color_control_capabilities, command, *references)
        return Limits(numbers[0].value, numbers[1].value, max(numbers[2].value, 1))

    def control(self, command: int) -> tuple[int, int]:
        """Mode (0 automatic, 1 manual) and value of a control."""
        mode, value = ctypes.c_int(), ctypes.c_int32()
        self._call(self.sdk.k4a_device_get_color_control, command, ctypes.byref(mode), ctypes.byref(value))
        return mode.value, value.value

    def set_control(self, command: int, mode: int, value: int) -> None:
        """Sets mode and value of a control."""
        self._call(self.sdk.k4a_device_set_color_control, command, mode, value)

    def close(self) -> None:
        """Ends the streams and closes the device; may be called again."""
        with self._calls, self._captures:
            self.stop()
            if self._handle is not None:
                self.sdk.k4a_device_close(self._handle)
            self._handle = None

    def _open(self) -> ctypes.c_void_p:
        if self._handle is None:
            raise DeviceError(f"{self.uri}: the device was closed")
        return self._handle

    def _call(self, function: Callable[..., int], *arguments: Any) -> None:
        with self._calls:
            library.forget()
            if function(self._open(), *arguments) != _SUCCEEDED:
                said = library.reason()
                remedy = f"; {_ENGINE_REMEDY}" if _ENGINE in said else ""
                raise DeviceError(f"{self.uri}: {said}{remedy}")

    def _buffer(self, function: Callable[..., int]) -> bytes:
        size = ctypes.c_size_t(0)
        with self._calls:
            if function(self._open(), None, ctypes.byref(size)) not in (_SUCCEEDED, _TOO_SMALL):
                raise DeviceError(f"{self.uri}: {library.reason()}")
            content = ctypes.create_string_buffer(size.value)
            self._call(function, content, ctypes.byref(size))
        return content.raw[: size.value].rstrip(b"\0")
