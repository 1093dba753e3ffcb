"""Microsoft's Azure Kinect SDK (libk4a), by its C interface.

Of `pyk4a-bundle` only the library is used: its Python modules are compiled for NumPy 1, and cannot be imported with 2.
"""

import ctypes
import importlib.metadata
import os
import re
from collections import deque
from collections.abc import Iterator
from ctypes import POINTER, c_bool, c_char_p, c_float, c_int, c_int32, c_size_t, c_uint32, c_uint64, c_void_p
from functools import cache
from typing import Any

from drivers.contract.device import SdkMissingError

#: The wheel's only requirement is NumPy, which is here.
_OPTIONS = "--no-deps"
#: The library of Microsoft's own packages, where the wheel is not installed.
_SYSTEM = "libk4a.so.1.4"
_ERROR = 1
_CALLBACK = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_int, c_char_p)
#: The place in the SDK's source at the beginning of what it reports.
_PLACE = re.compile(r"^\w+\(\)\. (?:/\S+ \(\d+\): )?")
_said: deque[str] = deque(maxlen=30)


class Configuration(ctypes.Structure):
    """`k4a_device_configuration_t`."""

    _fields_ = (
        ("color_format", c_int),
        ("color_resolution", c_int),
        ("depth_mode", c_int),
        ("camera_fps", c_int),
        ("synchronized_images_only", c_bool),
        ("depth_delay_off_color_usec", c_int32),
        ("wired_sync_mode", c_int),
        ("subordinate_delay_off_master_usec", c_uint32),
        ("disable_streaming_indicator", c_bool),
    )


class Versions(ctypes.Structure):
    """`k4a_hardware_version_t`: three numbers for each of colours, depth, audio and depth sensor; build, signature."""

    _fields_ = (("numbers", c_uint32 * 12), ("build", c_int), ("signature", c_int))


_INT, _SIZE, _HANDLE = POINTER(c_int32), POINTER(c_size_t), POINTER(c_void_p)
#: Result and arguments of every function that is used (include/k4a/k4a.h).
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "k4a_device_get_installed_count": (c_uint32,),
    "k4a_device_open": (c_int, c_uint32, _HANDLE),
    "k4a_device_close": (None, c_void_p),
    "k4a_device_get_serialnum": (c_int, c_void_p, c_char_p, _SIZE),
    "k4a_device_get_version": (c_int, c_void_p, POINTER(Versions)),
    "k4a_device_get_raw_calibration": (c_int, c_void_p, c_char_p, _SIZE),
    "k4a_device_start_cameras": (c_int, c_void_p, POINTER(Configuration)),
    "k4a_device_stop_cameras": (None, c_void_p),
    "k4a_device_get_capture": (c_int, c_void_p, _HANDLE, c_int32),
    "k4a_device_get_color_control": (c_int, c_void_p, c_int, POINTER(c_int), _INT),
    "k4a_device_set_color_control": (c_int, c_void_p, c_int, c_int, c_int32),
    "k4a_device_get_color_control_capabilities": (
        *(c_int, c_void_p, c_int, POINTER(c_bool)),
        *(_INT, _INT, _INT, _INT, POINTER(c_int)),
    ),
    "k4a_capture_get_depth_image": (c_void_p, c_void_p),
    "k4a_capture_get_ir_image": (c_void_p, c_void_p),
    "k4a_capture_get_color_image": (c_void_p, c_void_p),
    "k4a_capture_get_temperature_c": (c_float, c_void_p),
    "k4a_capture_release": (None, c_void_p),
    "k4a_image_get_buffer": (c_void_p, c_void_p),
    "k4a_image_get_size": (c_size_t, c_void_p),
    "k4a_image_get_format": (c_int, c_void_p),
    "k4a_image_get_width_pixels": (c_int, c_void_p),
    "k4a_image_get_height_pixels": (c_int, c_void_p),
    "k4a_image_get_device_timestamp_usec": (c_uint64, c_void_p),
    "k4a_image_get_exposure_usec": (c_uint64, c_void_p),
    "k4a_image_release": (None, c_void_p),
    "k4a_set_debug_message_handler": (c_int, _CALLBACK, c_void_p, c_int),
}


@cache
def load() -> Any:
    """The library, with declared functions. What it reports goes to `reason`, not to standard output.

    Raises:
        SdkMissingError: it is not installed, or cannot be loaded.
    """
    os.environ.setdefault("K4A_ENABLE_LOG_TO_STDOUT", "0")  # read when the library logs for the first time
    for name in _names():
        try:
            sdk = ctypes.CDLL(name)
        except OSError:
            continue
        for function, (result, *arguments) in _FUNCTIONS.items():
            getattr(sdk, function).restype = result
            getattr(sdk, function).argtypes = arguments
        sdk.k4a_set_debug_message_handler(_listen, None, _ERROR)
        return sdk
    raise SdkMissingError("pyk4a-bundle", options=_OPTIONS, newest_python=(3, 12))


def forget() -> None:
    """Forgets the SDK's reports, before a call whose failure is to be explained."""
    _said.clear()


def reason() -> str:
    """The SDK's reports since `forget`, without lines that only repeat them on the way up."""
    said = list(_said)
    causes = [text for text in said if " returned failure in " not in text]
    return "; ".join(dict.fromkeys(causes or said)) or "Azure Kinect's SDK gives no reason"


def _names() -> Iterator[str]:
    try:
        files = importlib.metadata.files("pyk4a-bundle") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    yield from (str(path.locate()) for path in files if path.name.startswith("libk4a-"))
    yield _SYSTEM


@_CALLBACK
def _listen(context: Any, level: int, file: bytes, line: int, message: bytes) -> None:
    _said.append(_PLACE.sub("", message.decode(errors="replace").strip()))
