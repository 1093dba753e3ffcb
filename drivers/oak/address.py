"""Addresses of OAK devices: `oak://`, `oak://18443010E1A2B3C4`, `oak://192.168.1.44`, `oak://?recording=FOLDER`."""

import re
from dataclasses import dataclass
from pathlib import Path

from drivers.contract.address import name, values
from drivers.contract.address_values import file, number, one_of, size, switch

_KEYS = {
    "mode": one_of("auto", "tof", "stereo"),
    "range": one_of("low", "mid", "high"),
    "sync": one_of("free", "master", "slave"),
    "color": switch,
    "undistort": switch,
    "network": switch,
    "fps": number(float, 1, 120),
    "dots": number(float, 0, 1),
    "flood": number(float, 0, 1),
    "size": size(10, 9999),
    "recording": file,
    "loop": switch,
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
    mode: str = "auto"
    range: str = "mid"
    sync: str = "free"
    color: bool = True
    undistort: bool = False
    network: bool = False
    fps: float = 30.0
    dots: float = 0.0
    flood: float = 0.0
    size: tuple[int, int] = (640, 400)
    recording: Path | None = None
    loop: bool = True


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    device = name(uri, "a serial number or an IP address")
    given = values(uri, _KEYS)
    if re.fullmatch(r"[\d.]+\.[\d.]+", device):
        given["network"] = True
    return Address(uri, device, **given)
