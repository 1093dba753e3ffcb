"""Addresses of OAK devices: `oak://`, `oak://18443010E1A2B3C4`, `oak://192.168.1.44`, `oak://?recording=FOLDER`."""

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from drivers.contract.device import AddressError

_CHOICES = {
    "mode": ("auto", "tof", "stereo"),
    "range": ("low", "mid", "high"),
    "sync": ("free", "master", "slave"),
    "color": ("0", "1"),
    "undistort": ("0", "1"),
    "network": ("0", "1"),
    "loop": ("0", "1"),
}
_NUMBERS = {"fps": (1.0, 120.0), "dots": (0.0, 1.0), "flood": (0.0, 1.0)}
_DEFAULTS = {
    "mode": "auto",
    "range": "mid",
    "sync": "free",
    "color": "1",
    "undistort": "0",
    "network": "0",
    "loop": "1",
    "fps": "30",
    "dots": "0",
    "flood": "0",
    "size": "640x400",
    "recording": "",
}


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        uri: the address itself.
        name: serial number or IP address, "" for the only device.
        mode: `tof`, `stereo`, or `auto`: the one that the device has.
        range: range profile of a time-of-flight camera: `low` has the lowest noise, `high` the longest range.
        sync: synchronisation role.
        color: True to stream colour images.
        undistort: True to undistort colour images on the device.
        network: True to discover devices on the network, too, by a broadcast.
        fps: exposures per second.
        dots, flood: initial brightness of the dot projector and of the infra-red flood light, 0 to 1.
        size: width and height of stereo and colour images [px].
        recording: file or folder that depthai plays instead of a device; None for a device.
        loop: True to repeat the recording.
    """

    uri: str
    name: str
    mode: str
    range: str
    sync: str
    color: bool
    undistort: bool
    network: bool
    fps: float
    dots: float
    flood: float
    size: tuple[int, int]
    recording: Path | None
    loop: bool


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    parts = urlsplit(uri)
    values = dict(_DEFAULTS)
    for key, value in parse_qsl(parts.query, keep_blank_values=True):
        if key not in values:
            raise AddressError(f"{uri}: unknown key {key!r}; allowed are {', '.join(sorted(values))}")
        if key in _CHOICES and value not in _CHOICES[key]:
            raise AddressError(f"{uri}: {key} = {value!r} must be one of {', '.join(_CHOICES[key])}")
        values[key] = value
    if parts.path.strip("/"):
        raise AddressError(f"{uri}: a serial number or an IP address is all that may stand before the '?'")
    size = re.fullmatch(r"([1-9]\d{1,3})x([1-9]\d{1,3})", values["size"])
    if size is None:
        raise AddressError(f"{uri}: size = {values['size']!r} must be a width and a height [px], such as 640x400")
    numbers = {key: _number(uri, key, values[key]) for key in _NUMBERS}
    return Address(
        uri=uri,
        name=parts.netloc,
        mode=values["mode"],
        range=values["range"],
        sync=values["sync"],
        color=values["color"] == "1",
        undistort=values["undistort"] == "1",
        network=values["network"] == "1" or re.fullmatch(r"[\d.]+\.[\d.]+", parts.netloc) is not None,
        fps=numbers["fps"],
        dots=numbers["dots"],
        flood=numbers["flood"],
        size=(int(size[1]), int(size[2])),
        recording=Path(values["recording"]) if values["recording"] else None,
        loop=values["loop"] == "1",
    )


def _number(uri: str, key: str, text: str) -> float:
    low, high = _NUMBERS[key]
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise AddressError(f"{uri}: {key} = {text!r} must be a number from {low:g} to {high:g}")
    return value
