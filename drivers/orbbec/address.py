"""Addresses of Orbbec cameras: `orbbec://`, `orbbec://CL8FC3100XX?depth=640x576`, `orbbec://?recording=FILE.bag`."""

import ipaddress
from dataclasses import dataclass
from pathlib import Path

from drivers.contract.address import name, values
from drivers.contract.address_values import file, mode


@dataclass(frozen=True, slots=True)
class Mode:
    """Wanted size [px] and rate [Hz] of a stream; 0 where the camera's default will do."""

    width: int = 0
    height: int = 0
    rate_hz: int = 0


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        uri: the address itself.
        serial: serial number, "" for the only camera.
        host: IP address of a camera on the network, "" for one on USB.
        depth, ir, color, confidence: modes of the streams, None for no such stream.
        recording: file of the SDK's recorder, played instead of a camera; None for a camera.
    """

    uri: str
    serial: str
    host: str
    depth: Mode | None = Mode()
    ir: Mode | None = Mode()
    color: Mode | None = Mode()
    confidence: Mode | None = None
    recording: Path | None = None


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    device = name(uri, "a serial number or an IP address")
    host = device if _is_ip(device) else ""
    return Address(uri, "" if host else device, host, **values(uri, _KEYS))


def _is_ip(text: str) -> bool:
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True


def _mode(text: str) -> Mode | None:
    if text in ("0", "1"):
        return Mode() if text == "1" else None
    return Mode(*mode(text, "0 (none), 1 (the camera's default), or "))


_KEYS = {**dict.fromkeys(("depth", "ir", "color", "confidence"), _mode), "recording": file}
