"""Lazy import of ifm3dpy without its own log, and translation of its errors."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from drivers.contract.device import DeviceError, SdkMissingError

#: Time after which ifm3d gives up a call of the configuration interface [ms]; its default is 3000.
_PATIENCE_MS = "2000"


def load() -> Any:
    """The module `ifm3dpy`.

    Raises:
        SdkMissingError: it is not installed.
    """
    os.environ.setdefault("IFM3D_NET_WAIT", _PATIENCE_MS)  # read once, when the library is loaded
    try:
        import ifm3dpy  # noqa: PLC0415  an extra
    except ImportError as error:
        raise SdkMissingError("ifm3dpy", "ifm", newest_python=(3, 13), error=error) from error
    ifm3dpy.logging.Logger.set_log_level(ifm3dpy.logging.LogLevel.Critical)  # the rest is raised or counted, too
    return ifm3dpy


@contextmanager
def translated_errors(uri: str) -> Iterator[None]:
    """Translates exceptions of ifm3d, which are `RuntimeError`s, into errors that name the device.

    Raises:
        DeviceError: any exception of ifm3d.
    """
    try:
        yield
    except RuntimeError as error:
        raise DeviceError(f"{uri}: {reason(error)}") from error


def reason(error: RuntimeError) -> str:
    """Reason of an exception of ifm3d in plain words."""
    return f"the processing unit does not answer as expected (ifm3d says: {' '.join(str(error).split())})"
