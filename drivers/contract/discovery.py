"""What a driver finds attached, and which of it an address means.

Every driver has a function `discover(timeout_s: float) -> list[Found]`. It never raises, opens nothing for longer than
it must, and also reports what it sees but could not open.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from drivers.contract.device import DeviceInfo
from drivers.contract.errors import DeviceError

#: What to do when a user may not open a device on USB.
UDEV_REMEDY = "abs-service devices --udev | sudo tee /etc/udev/rules.d/60-abs-service.rules  and plug it in again"


class Availability(StrEnum):
    """Whether a device could be opened now, and if not, what kind of obstacle there is."""

    READY = "ready"
    BUSY = "in use"
    NO_PERMISSION = "no permission"
    SDK_MISSING = "driver not installed"
    FAULTY = "faulty"


@dataclass(frozen=True, slots=True)
class Found:
    """A device that is attached, or a driver that cannot look for any.

    Attributes:
        info: who it is. `uri` opens this device and no other, on whatever port it is next time; what the driver cannot
            find out without opening it is "".
        availability: whether it can be opened.
        reason: why not, in plain words; "" if it can.
        remedy: what to do about it, a command where there is one; "" if nothing is to be done.
    """

    info: DeviceInfo
    availability: Availability = Availability.READY
    reason: str = ""
    remedy: str = ""


def choose(found: Sequence[Found], scheme: str, serial: str) -> Found:
    """The device that `scheme://serial` means; without a serial number the only one that is attached.

    Args:
        found: what the driver's `discover` has found.
        scheme: of the driver.
        serial: wanted serial number, "" for the only device.

    Raises:
        DeviceError: there is none, there are several to choose from, or it cannot be opened; says what to do.
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
