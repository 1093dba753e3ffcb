"""Lazy import of pyrealsense2, and translation of its errors."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from drivers.contract.device import DeviceError, SdkMissingError


def load() -> Any:
    """The module `pyrealsense2`.

    Raises:
        SdkMissingError: it is not installed.
    """
    try:
        import pyrealsense2  # noqa: PLC0415  an extra
    except ImportError as error:
        raise SdkMissingError("pyrealsense2", "realsense") from error
    return pyrealsense2


@contextmanager
def translated_errors(uri: str) -> Iterator[None]:
    """Translates exceptions of librealsense, plain `RuntimeError`s, into errors that name the device and the remedy.

    Raises:
        DeviceError: any exception of librealsense.
    """
    try:
        yield
    except DeviceError:
        raise
    except Exception as error:
        message = str(error)
        if "permission" in message.lower() or "access" in message.lower():
            message = (
                f"{message}; librealsense's udev rules give access: config/99-realsense-libusb.rules of its sources"
            )
        elif "busy" in message.lower():
            message = f"another program uses it ({message})"
        raise DeviceError(f"{uri}: {message}") from error
