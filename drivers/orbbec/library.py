"""Lazy import of pyorbbecsdk, its settings, and translation of its errors."""

import ctypes
import os
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from drivers.contract.device import SdkMissingError
from drivers.contract.discovery import UDEV_REMEDY
from drivers.contract.errors import translated_sdk_errors

#: Threads of a context begin within this time [s]. One that has not when the context ends is not notified, and the end
#: waits for it for 60 s (SDK 2.9).
_BEGINS_S = 0.1

#: The wheel's requirements are those of its examples: 2 GB, and an older NumPy than ours.
_OPTIONS = "--no-deps"


def load() -> Any:
    """The module `pyorbbecsdk`.

    Raises:
        SdkMissingError: it is not installed.
    """
    try:
        with _silent():
            import pyorbbecsdk  # noqa: PLC0415  no requirement of ours
    except ImportError as error:
        raise SdkMissingError("pyorbbecsdk2", options=_OPTIONS, newest_python=(3, 13), error=error) from error
    return pyorbbecsdk


def context(ob: Any) -> Any:
    """The SDK's context with `sdk.xml`; the settings hold while somebody holds it."""
    made = ob.Context(str(Path(__file__).with_name("sdk.xml")))
    time.sleep(_BEGINS_S)
    return made


def translated_errors(uri: str) -> AbstractContextManager[None]:
    """Translates exceptions into errors that name the device and the remedy; the SDK's own have no common base.

    Raises:
        DeviceError: any exception.
    """
    return translated_sdk_errors(uri, UDEV_REMEDY)


@contextmanager
def _silent() -> Iterator[None]:
    """Standard output leads nowhere: the SDK prints a line when it is imported, into a user's JSON."""
    if "pyorbbecsdk" in sys.modules:
        yield
        return
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C still holds back would come when the process ends
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
