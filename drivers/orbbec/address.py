"""Addresses of Orbbec cameras: `orbbec://`, `orbbec://CL8FC3100XX?depth=640x576`, `orbbec://?recording=FILE.bag`."""

import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from drivers.contract.address import query
from drivers.contract.device import AddressError

_DEFAULTS = {"depth": "1", "ir": "1", "color": "1", "confidence": "0", "recording": ""}
_MODE = re.compile(r"([1-9]\d{1,3})x([1-9]\d{1,3})(?:@([1-9]\d{0,2}))?")
_ALLOWED = "0 (none), 1 (the camera's default), or a width and a height [px], such as 640x576, with a rate 640x576@30"


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
    depth: Mode | None
    ir: Mode | None
    color: Mode | None
    confidence: Mode | None
    recording: Path | None


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    parts = urlsplit(uri)
    values = query(uri, _DEFAULTS)
    if parts.path.strip("/"):
        raise AddressError(f"{uri}: a serial number or an IP address is all that may stand before the '?'")
    host = parts.netloc if _is_ip(parts.netloc) else ""
    return Address(
        uri=uri,
        serial="" if host else parts.netloc,
        host=host,
        depth=_mode(uri, "depth", values["depth"]),
        ir=_mode(uri, "ir", values["ir"]),
        color=_mode(uri, "color", values["color"]),
        confidence=_mode(uri, "confidence", values["confidence"]),
        recording=Path(values["recording"]) if values["recording"] else None,
    )


def _is_ip(text: str) -> bool:
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True


def _mode(uri: str, key: str, text: str) -> Mode | None:
    if text in {"0", "1"}:
        return Mode() if text == "1" else None
    match = _MODE.fullmatch(text)
    if match is None:
        raise AddressError(f"{uri}: {key} = {text!r} must be {_ALLOWED}")
    return Mode(int(match[1]), int(match[2]), int(match[3] or 0))
