"""Recordings: read offline frame by frame, or played in real time as the device `replay://FILE?speed=1&loop=0`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from drivers.contract.address import split, values
from drivers.contract.address_values import number, switch
from drivers.contract.device import AddressError, Device
from drivers.contract.discovery import Found
from drivers.replay.contents import RecordingError
from drivers.replay.device import ReplayDevice
from drivers.replay.recording import Recording

__all__ = ["Recording", "RecordingError", "ReplayDevice", "check_address", "discover", "open_device"]

_KEYS = {"speed": number(float, 0.01, 100), "loop": switch, "delay": number(float, 0, 3600)}


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `replay://recordings/a.mcap` (relative) or `replay:///data/a.mcap` (absolute).

    Keys: `speed`, factor on the recorded speed, 1 if not given; `loop`, 1 to restart at the end, 0 if not given;
    `delay`, time before the first frame [s], so that subscribers can connect first.

    Raises:
        AddressError: invalid address, or the file cannot be replayed.
    """
    address = check_address(uri)
    try:
        recording = Recording(address.path)
        return ReplayDevice(uri, recording, address.speed, address.loop, clock, delay_s=address.delay_s)
    except RecordingError as error:
        raise AddressError(str(error)) from error


@dataclass(frozen=True)
class Address:
    """A parsed address: the file, the factor on its speed, whether it repeats, and the time before it begins [s]."""

    path: Path
    speed: float
    loop: bool
    delay_s: float


def check_address(uri: str) -> Address:
    """Parses an address; whether there is such a file is not looked at.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    parts, given = split(uri), values(uri, _KEYS)
    path = Path(unquote(parts.netloc + parts.path))
    return Address(path, given.get("speed", 1.0), given.get("loop", False), given.get("delay", 0.0))


def discover(timeout_s: float) -> list[Found]:
    """Empty: recordings are not discovered."""
    return []
