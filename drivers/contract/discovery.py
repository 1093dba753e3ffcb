"""Discovery of attached devices, and selection of the device that an address names.

Every driver has a function `discover(timeout_s: float) -> list[Found]`. It never raises, keeps nothing open longer than
necessary, and also reports devices that cannot be opened.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from drivers.contract.device import DeviceInfo
from drivers.contract.errors import DeviceError

#: Remedy for missing permission to open a USB device.
UDEV_REMEDY = "abs-service devices --udev | sudo tee /etc/udev/rules.d/60-abs-service.rules  and plug it in again"


class Availability(StrEnum):
    """READY if a device can be opened now, else the kind of obstacle."""

    READY = "ready"
    BUSY = "in use"
    NO_PERMISSION = "no permission"
    SDK_MISSING = "driver not installed"
    FAULTY = "faulty"


@dataclass(frozen=True, slots=True)
class Found:
    """An attached device, or a driver whose discovery failed.

    Attributes:
        info: its identity. `uri` opens this device and no other, on any port; fields unknown before opening are "".
        availability: READY, or the kind of obstacle.
        reason: the obstacle in plain words; "" if READY.
        remedy: how to remove the obstacle, if possible as a command; "" if there is none.
    """

    info: DeviceInfo
    availability: Availability = Availability.READY
    reason: str = ""
    remedy: str = ""


def choose(found: Sequence[Found], scheme: str, serial: str) -> Found:
    """The device that `scheme://serial` names; without a serial number the only attached one.

    Args:
        found: result of the driver's `discover`.
        scheme: of the driver.
        serial: wanted serial number, "" for the only device.

    Raises:
        DeviceError: no match, several matches, or it cannot be opened; names the remedy.
    """
    fitting = [one for one in found if serial in {"", one.info.serial}]
    there_are = ", ".join(one.info.uri for one in found) or "none"
    if not fitting:
        wanted = f"{scheme}://{serial} is" if serial else f"no {scheme} device is"
        raise DeviceError(f"{wanted} not attached; attached: {there_are}" if serial else f"{wanted} attached")
    if len(fitting) > 1:
        raise DeviceError(f"{len(found)} {scheme} devices are attached; say which one: {there_are}")
    if fitting[0].availability != Availability.READY:
        raise DeviceError(f"{fitting[0].info.uri}: {fitting[0].reason}; {fitting[0].remedy}".rstrip("; "))
    return fitting[0]
