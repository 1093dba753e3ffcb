"""Lazy import of harvesters, and the GenTL producers of this process."""

import logging
import os
import threading
from functools import cache
from pathlib import Path
from typing import Any

from drivers.contract.device import DeviceInfo, SdkMissingError
from drivers.contract.discovery import Availability, Found, choose

#: Environment variable of the GenTL standard with the folders of producers; manufacturers' installers set it.
VARIABLE = "GENICAM_GENTL64_PATH"
#: GenTL's access status of a camera that can be opened: unknown, or read and write.
_FREE = frozenset({"", "0", "1"})
_LINKS = {"GEV": "GigE Vision", "U3V": "USB3 Vision"}


def load() -> Any:
    """The module `harvesters.core`.

    Raises:
        SdkMissingError: it is not installed.
    """
    try:
        from harvesters import core  # noqa: PLC0415  an extra
    except ImportError as error:
        raise SdkMissingError("harvesters", "genicam", error=error) from error
    logging.getLogger(core.__name__).setLevel(
        logging.CRITICAL
    )  # what it says to the terminal is raised or counted, too
    return core


class Producers:
    """All producers that `VARIABLE` names. Thread-safe.

    Args:
        core: `harvesters.core`.
    """

    def __init__(self, core: Any) -> None:
        self._core = core
        self._harvester = core.Harvester()
        self._interfaces: set[Any] = set()
        self._lock = threading.Lock()

    def found(self, timeout_s: float) -> list[Found]:
        """Attached cameras; the search of a GigE Vision producer is a broadcast on its networks."""
        with self._lock:
            return [_found(info) for info in self._search(timeout_s)]

    def open(self, serial: str, timeout_s: float) -> tuple[Any, DeviceInfo]:
        """Acquirer (`core.ImageAcquirer`) of a camera, and its identity; an empty serial number is the only camera's.

        Raises:
            DeviceError: no such camera, or it is in use.
        """
        with self._lock:
            attached = [(info, _found(info)) for info in self._search(timeout_s)]
            chosen = choose([found for _, found in attached], "genicam", serial)
            (info,) = (info for info, found in attached if found is chosen)
            return self._harvester.create(info), chosen.info

    def _search(self, timeout_s: float) -> list[Any]:
        """Attached cameras, as `core.DeviceInfo`. `Harvester.update` would close all that are open."""
        harvester = self._harvester
        timeout_ms = round(timeout_s * 1000)
        if any(acquirer.is_valid() for acquirer in harvester.image_acquirers):
            for interface in self._interfaces:
                interface.module.update_device_info_list(timeout_ms)
            attached = [(one, raw) for one in self._interfaces for raw in one.module.device_info_list]
            harvester.device_info_list[:] = [self._core.DeviceInfo(module=raw, parent=one) for one, raw in attached]
        else:
            for path in files():
                harvester.add_file(path)
            harvester.timeout_for_update = timeout_ms
            harvester.update()
            self._interfaces = {info.parent for info in harvester.device_info_list}
        return list(harvester.device_info_list)


@cache
def _producers() -> Producers:
    return Producers(load())


_lock = threading.Lock()


def producers() -> Producers:
    """The producers of this process, of which there can be one: a producer refuses to be loaded twice.

    Raises:
        SdkMissingError: harvesters is not installed.
    """
    with _lock:
        return _producers()


def files() -> list[str]:
    """Producers in the folders that `VARIABLE` names."""
    folders = [Path(folder) for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]
    return [str(file) for folder in folders for file in sorted(folder.glob("*.cti"))]


def _found(info: Any) -> Found:
    serial = _text(info, "serial_number") or _text(info, "id_")
    model = " ".join(filter(None, (_text(info, "vendor"), _text(info, "model")))) or "GenICam"
    link = _text(info, "tl_type")
    identity = DeviceInfo(f"genicam://{serial}", model, serial, link=_LINKS.get(link, link))
    if _text(info, "access_status") in _FREE:
        return Found(identity)
    return Found(identity, Availability.BUSY, "another program uses it", "close that one")


def _text(info: Any, name: str) -> str:
    try:
        return str(getattr(info, name) or "")
    except Exception:  # the producer's, for what it does not know
        return ""
