"""Discovery of attached cameras: identity and availability."""

import errno
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import libusb_package
import usb.backend.libusb1 as libusb
import usb.core
import usb.util

from drivers.contract.device import DeviceInfo
from drivers.contract.discovery import UDEV_REMEDY, Availability, Found
from drivers.kinect1 import usb_numbers

#: Factory of pyusb backends.
BackendFactory = Callable[[], Any]

_INTERFACE = 0
_ENGLISH = 0x0409
_LINKS = {1: "USB 1, 1.5 Mbit/s", 2: "USB 1, 12 Mbit/s", 3: "USB 2, 480 Mbit/s", 4: "USB 3, 5 Gbit/s"}
_HIGH_SPEED = 3


@dataclass(frozen=True, eq=False)
class AttachedCamera:
    """An attached camera: discovery result and pyusb device."""

    found: Found
    device: usb.core.Device


_LibUSB: Any = libusb._LibUSB  # noqa: SLF001


class _Libusb(_LibUSB):
    """A libusb backend that outlives its devices, which are released into it."""

    def enumerate_devices(self) -> Iterator[Any]:
        for device in super().enumerate_devices():
            device.libusb = self
            yield device


def fresh_backend() -> Any:
    """A new libusb backend, which enumerates the bus even where no hot-plug events arrive (containers).

    Raises:
        RuntimeError: libusb cannot be loaded.
    """
    if libusb.get_backend(find_library=libusb_package.find_library) is None:
        raise RuntimeError("no libusb-1.0 can be loaded")
    return _Libusb(libusb._lib)  # noqa: SLF001


def list_attached(backend: Any) -> list[AttachedCamera]:
    """All cameras on the bus; none is left open.

    Raises:
        usb.core.USBError: the bus cannot be searched.
    """
    devices: list[Any] = list(usb.core.find(find_all=True, idVendor=usb_numbers.VENDOR, backend=backend) or ())
    result = []
    for device in devices:
        if device.idProduct in usb_numbers.CAMERAS:
            result.append(AttachedCamera(_probe(device, devices), device))
            usb.util.dispose_resources(device)
    return result


def _probe(device: Any, neighbours: list[Any]) -> Found:
    availability, reason, remedy = Availability.READY, "", ""
    serial = ""
    try:
        serial = _serial(device, neighbours)
        _try_to_claim(device)
    except usb.core.USBError as error:
        availability, reason, remedy = _availability(error)
        serial = serial or _public_serial(device)
    if device.speed is not None and device.speed < _HIGH_SPEED and availability == Availability.READY:
        availability, reason = Availability.FAULTY, f"it is attached by {_LINKS.get(device.speed, 'a slow link')}"
        remedy = "it needs USB 2 with 480 Mbit/s: use another port or cable"
    info = DeviceInfo(
        uri=f"kinect1://{serial}",
        model=usb_numbers.CAMERAS[device.idProduct],
        serial=serial,
        firmware=f"{device.bcdDevice >> 8:x}.{device.bcdDevice & 0xFF:02x}",
        link=_LINKS.get(device.speed or 0, ""),
    )
    return Found(info, availability, reason, remedy)


def _serial(device: Any, neighbours: list[Any]) -> str:
    """Serial number of the camera or, if it is all zeros, of the audio device in the same housing; "" if none."""
    serial = _read_serial(device)
    if serial.strip("0"):
        return serial
    for other in neighbours:
        if other.idProduct in usb_numbers.AUDIO and _hub(other) == _hub(device):
            with suppress(usb.core.USBError):
                serial = _read_serial(other)
            usb.util.dispose_resources(other)
    return serial if serial.strip("0") else ""


def _read_serial(device: Any) -> str:
    if device.iSerialNumber == 0:
        return ""
    try:
        text = usb.util.get_string(device, device.iSerialNumber, _ENGLISH) or ""
    except (ValueError, IndexError):  # no string descriptor
        return ""
    return "".join(letter for letter in text if letter.isascii() and letter.isalnum())


def _public_serial(device: Any) -> str:
    """Serial number from sysfs, readable without permission to open the camera; "" if none."""
    ports = ".".join(map(str, device.port_numbers or ()))
    try:
        serial = Path(f"/sys/bus/usb/devices/{device.bus}-{ports}/serial").read_text(encoding="utf-8").strip()
    except (OSError, ValueError):
        return ""
    return serial if serial.isascii() and serial.isalnum() and serial.strip("0") else ""


def _hub(device: Any) -> tuple[Any, ...]:
    """Location of the device's hub: camera and audio device share a hub in the housing."""
    return (device.bus, *(device.port_numbers or (device.address,))[:-1])


def _try_to_claim(device: Any) -> None:
    """Raises if another program has claimed it; the kernel driver can be detached and is no obstacle."""
    with suppress(NotImplementedError):
        if device.is_kernel_driver_active(_INTERFACE):
            return
    usb.util.claim_interface(device, _INTERFACE)
    usb.util.release_interface(device, _INTERFACE)


def _availability(error: usb.core.USBError) -> tuple[Availability, str, str]:
    match error.errno:
        case errno.EACCES | errno.EPERM:
            return Availability.NO_PERMISSION, "you may not open it", UDEV_REMEDY
        case errno.EBUSY:
            return Availability.BUSY, "another program uses it", "end that program"
    return Availability.FAULTY, f"it does not answer ({error.strerror})", "plug it in again and check its power supply"
