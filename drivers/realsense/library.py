"""Lazy import of pyrealsense2, and translation of its errors."""

from contextlib import AbstractContextManager
from typing import Any

from drivers.contract.device import SdkMissingError
from drivers.contract.errors import translated_sdk_errors


def load() -> Any:
    """The module `pyrealsense2`.

    Raises:
        SdkMissingError: it is not installed.
    """
    try:
        import pyrealsense2  # noqa: PLC0415  an extra
    except ImportError as error:
        raise SdkMissingError("pyrealsense2", "realsense", error=error) from error
    return pyrealsense2


def translated_errors(uri: str) -> AbstractContextManager[None]:
    """Translates exceptions of librealsense, plain `RuntimeError`s, into errors that name the device and the remedy.

    Raises:
        DeviceError: any exception of librealsense.
    """
    return translated_sdk_errors(
        uri, "librealsense's udev rules give access: config/99-realsense-libusb.rules of its sources"
    )
