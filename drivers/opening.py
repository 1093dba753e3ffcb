"""Opens devices and other programs' recordings, and discovers attached devices; a scheme names a driver module."""

import importlib
import importlib.metadata
import pkgutil
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from pathlib import Path
from threading import Thread
from types import ModuleType
from typing import Any

import drivers
from drivers.contract.address import split
from drivers.contract.device import AddressError, Device, DeviceInfo
from drivers.contract.discovery import Availability, Found
from drivers.encoding.foreign_recording import ForeignRecording

#: Time beyond its timeout after which a driver is abandoned [s].
GRACE_S = 1.0


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `scheme://…` with `drivers.<scheme>.open_device`; only that driver is imported.

    Args:
        uri: address of the device.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        AddressError: no such driver, one that cannot be imported, or an invalid address.
        DeviceError: the driver cannot open the device now.
    """
    return _driver_of(uri).open_device(uri, clock)


def check_address(uri: str) -> None:
    """Checks an address with `drivers.<scheme>.check_address`, without its device.

    Raises:
        AddressError: no such driver, or an address that no device can have.
    """
    _driver_of(uri).check_address(uri)


def open_recording(program: str, path: Path) -> ForeignRecording:
    """Opens a recording of another program with `drivers.<program>.open_recording`; only that driver is imported.

    Raises:
        ForeignRecordingError: it cannot be read.
    """
    return importlib.import_module(f"drivers.{program}").open_recording(path)


def available() -> list[str]:
    """Schemes of all drivers; imports every module of this package, which by contract imports no device SDK.

    Those of other distributions are not imported: one that is broken is named as one that works.
    """
    installed = {point.name for point in entry_points(drivers.__name__)}
    modules = _modules().items()
    return [one for one, module in modules if one in installed or _opens_devices(importlib.import_module(module))]


def discover(timeout_s: float, grace_s: float = GRACE_S) -> list[Found]:
    """Attached devices of all drivers, which search concurrently; never raises.

    Args:
        timeout_s: timeout of each driver [s]. A driver that exceeds it or raises is reported as faulty.
        grace_s: time beyond it after which a driver is abandoned [s].
    """
    searches = {scheme: _search(scheme, timeout_s) for scheme in available()}
    return [one for scheme, search in searches.items() for one in _result(scheme, search, timeout_s, grace_s)]


def _search(scheme: str, timeout_s: float) -> Future[list[Found]]:
    """Searches in a daemon thread, so that a hanging driver does not block the end of the process."""
    result: Future[list[Found]] = Future()

    def run() -> None:
        try:
            result.set_result(importlib.import_module(_modules()[scheme]).discover(timeout_s))
        except Exception as error:
            result.set_exception(error)

    Thread(target=run, name=f"discover {scheme}", daemon=True).start()
    return result


def _result(scheme: str, search: Future[list[Found]], timeout_s: float, grace_s: float) -> list[Found]:
    try:
        return search.result(timeout_s + grace_s)
    except TimeoutError:
        reason, remedy = f"the driver has not answered for {timeout_s:g} s", "on a slow or busy machine: --timeout 30"
    except Exception as error:
        reason, remedy = f"the driver broke while looking: {error!r}", "please report this"
    return [Found(DeviceInfo(f"{scheme}://", scheme, ""), Availability.FAULTY, reason, remedy)]


@cache
def entry_points(group: str) -> importlib.metadata.EntryPoints:
    """Entry points of a group, of all installed distributions; looked for once in a process, as `declared` are."""
    return declared().select(group=group)


@cache
def declared() -> importlib.metadata.EntryPoints:
    """All entry points, looked for once in a process: that takes 12 ms, and a rig file has a dozen parts."""
    found: Any = importlib.metadata.entry_points()  # until Python 3.11 of another class, with the same `select`
    return found


def _modules() -> dict[str, str]:
    """Modules by scheme: of this package, and of installed distributions (entry points of the group `drivers`)."""
    own = {module.name: f"{drivers.__name__}.{module.name}" for module in pkgutil.iter_modules(drivers.__path__)}
    return own | {point.name: point.value for point in entry_points(drivers.__name__)}


def _driver_of(uri: str) -> ModuleType:
    scheme = split(uri).scheme
    module = _modules().get(scheme, __name__)
    try:
        driver = importlib.import_module(module)
    except Exception as error:  # whatever the code of another distribution raises
        raise AddressError(f"{uri}: its driver {module} cannot be imported: {error!r}") from error
    if not _opens_devices(driver):
        raise AddressError(f"{uri!r}: scheme {scheme!r} is none of {available()}")
    return driver


def _opens_devices(module: ModuleType) -> bool:
    return hasattr(module, "open_device") and module.__name__ != __name__
