"""Opens a device by its address, or another program's recording: the scheme is the name of a module of this package."""

import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from urllib.parse import urlsplit

import drivers
from drivers.device import AddressError, Device
from drivers.footage import Footage


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `scheme://…` with `drivers.<scheme>.open_device`; only that driver is imported.

    Args:
        uri: address of the device.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        AddressError: no such driver, or the driver does not understand the address.
        DeviceError: the driver cannot open the device now.
    """
    scheme = urlsplit(uri).scheme
    modules = {module.name for module in pkgutil.iter_modules(drivers.__path__)}
    driver = _driver(scheme) if scheme in modules else None
    if driver is None:
        raise AddressError(f"{uri!r}: scheme {scheme!r} is none of {available()}")
    return driver.open_device(uri, clock)


def open_recording(program: str, path: Path) -> Footage:
    """Opens a file that another program recorded with `drivers.<program>.open_recording`; only that driver is imported.

    Raises:
        FootageError: it cannot be read.
    """
    return importlib.import_module(f"drivers.{program}").open_recording(path)


def available() -> list[str]:
    """Schemes of all drivers; imports every module of this package, which by contract imports no device SDK."""
    return [module.name for module in pkgutil.iter_modules(drivers.__path__) if _driver(module.name)]


def _driver(scheme: str) -> ModuleType | None:
    module = importlib.import_module(f"drivers.{scheme}")
    return module if hasattr(module, "open_device") and module.__name__ != __name__ else None
