"""Recordings: read frame by frame without a clock, or played as a device at `replay://FILE?speed=1&loop=0`."""

from collections.abc import Callable
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlsplit

from drivers.device import AddressError, Device
from drivers.replay.contents import RecordingError
from drivers.replay.device import ReplayDevice
from drivers.replay.recording import Recording

__all__ = ["Recording", "RecordingError", "ReplayDevice", "open_device"]

_SPEEDS = (0.01, 100.0)


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `replay://recordings/a.mcap` (relative) or `replay:///data/a.mcap` (absolute).

    Keys: `speed`, factor on the recorded pace, 1 if not given; `loop`, 1 to begin anew at the end, 0 if not given.

    Raises:
        AddressError: the address is not understood, or the file cannot be replayed.
    """
    parts = urlsplit(uri)
    values = {"speed": "1", "loop": "0"}
    for key, value in parse_qsl(parts.query, keep_blank_values=True):
        if key not in values:
            raise AddressError(f"{uri}: unknown key {key!r}; allowed are {sorted(values)}")
        values[key] = value
    if values["loop"] not in {"0", "1"}:
        raise AddressError(f"{uri}: loop = {values['loop']!r} must be 0 or 1")
    speed = _speed(uri, values["speed"])
    path = Path(unquote(parts.netloc + parts.path))
    try:
        return ReplayDevice(uri, Recording(path), speed, values["loop"] == "1", clock)
    except RecordingError as error:
        raise AddressError(str(error)) from error


def _speed(uri: str, value: str) -> float:
    try:
        speed = float(value)
    except ValueError:
        speed = float("nan")
    if not _SPEEDS[0] <= speed <= _SPEEDS[1]:
        raise AddressError(f"{uri}: speed = {value!r} must be a number from {_SPEEDS[0]:g} to {_SPEEDS[1]:g}")
    return speed
