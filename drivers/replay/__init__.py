"""Recordings: read offline frame by frame, or played in real time as the device `replay://FILE?speed=1&loop=0`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlsplit

from drivers.contract.device import AddressError, Device
from drivers.contract.discovery import Found
from drivers.replay.contents import RecordingError
from drivers.replay.device import ReplayDevice
from drivers.replay.recording import Recording

__all__ = ["Recording", "RecordingError", "ReplayDevice", "check_address", "discover", "open_device"]

_SPEEDS = (0.01, 100.0)
_DELAYS_S = (0.0, 3600.0)


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
    parts = urlsplit(uri)
    values = {"speed": "1", "loop": "0", "delay": "0"}
    for key, value in parse_qsl(parts.query, keep_blank_values=True):
        if key not in values:
            raise AddressError(f"{uri}: unknown key {key!r}; allowed are {sorted(values)}")
        values[key] = value
    if values["loop"] not in {"0", "1"}:
        raise AddressError(f"{uri}: loop = {values['loop']!r} must be 0 or 1")
    speed = _number(uri, "speed", values["speed"], _SPEEDS)
    delay_s = _number(uri, "delay", values["delay"], _DELAYS_S)
    return Address(Path(unquote(parts.netloc + parts.path)), speed, values["loop"] == "1", delay_s)


def discover(timeout_s: float) -> list[Found]:
    """Empty: recordings are not discovered."""
    return []


def _number(uri: str, key: str, value: str, limits: tuple[float, float]) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not limits[0] <= number <= limits[1]:
        raise AddressError(f"{uri}: {key} = {value!r} must be a number from {limits[0]:g} to {limits[1]:g}")
    return number
