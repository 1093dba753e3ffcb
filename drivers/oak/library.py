"""Lazy import of depthai with network access disabled, and translation of its errors.

By default depthai contacts a telemetry server when a pipeline starts, and broadcasts on every network interface to
discover devices. It reads its settings from the environment when it is loaded or when it searches.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from drivers.contract.device import DeviceError, SdkMissingError
from drivers.contract.discovery import UDEV_REMEDY

#: Timeout of device discovery [ms]; depthai's default is ten seconds.
SEARCH_MS = 1500

_ENVIRONMENT = {"DEPTHAI_TELEMETRY": "0", "DEPTHAI_LEVEL": "error"}


def load(network: bool = False, search_ms: int = SEARCH_MS) -> Any:
    """The module `depthai`.

    Args:
        network: True to allow discovery on the network; the user's environment has precedence.
        search_ms: timeout of device discovery [ms].

    Raises:
        SdkMissingError: it is not installed.
    """
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    os.environ["DEPTHAI_SEARCH_TIMEOUT"] = str(search_ms)
    if _USERS_PROTOCOL is None:
        os.environ["DEPTHAI_PROTOCOL"] = "any" if network else "usb"
    try:
        import depthai  # noqa: PLC0415  an extra, and half a second
    except ImportError as error:
        raise SdkMissingError("depthai", "oak", error=error) from error
    return depthai


_USERS_PROTOCOL = os.environ.get("DEPTHAI_PROTOCOL")


@contextmanager
def translated_errors(uri: str) -> Iterator[None]:
    """Translates exceptions of depthai, mostly `RuntimeError`s, into errors that name the device and the remedy.

    Raises:
        DeviceError: any exception of depthai.
    """
    try:
        yield
    except DeviceError:
        raise
    except Exception as error:
        raise DeviceError(f"{uri}: {_advice(str(error))}") from error


def _advice(message: str) -> str:
    lower = message.lower()
    if "no available devices" in lower or "cannot find any device" in lower or "retrieve all connected" in lower:
        return "no such device is attached; is it plugged in, with enough power?"
    if "permission" in lower:
        return f"{message}; {UDEV_REMEDY}"
    if "x_link" in lower or "already" in lower or "booted" in lower:
        return f"the device does not answer or another program uses it ({message})"
    return message
