"""Addresses of RealSense cameras: `realsense://`, `realsense://728612070259?fps=60`, `realsense://?recording=FILE.db3`."""

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from drivers.contract.device import AddressError

_DEFAULTS = {"depth": "640x480", "color": "640x480", "fps": "30", "ir": "1", "recording": ""}
_SIZE = re.compile(r"([1-9]\d{1,3})x([1-9]\d{1,3})")


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        uri: the address itself.
        serial: serial number, "" for the only camera.
        depth, color: image sizes of depth, infra-red and confidence, and of colour [px]; None for no colour.
        fps: exposures per second.
        ir: True to stream infra-red images.
        recording: file of librealsense's recorder, played instead of a camera; None for a camera.
    """

    uri: str
    serial: str
    depth: tuple[int, int]
    color: tuple[int, int] | None
    fps: int
    ir: bool
    recording: Path | None


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
        values[key] = value
    if parts.path.strip("/"):
        raise AddressError(f"{uri}: a serial number is all that may stand before the '?'")
    if values["ir"] not in {"0", "1"}:
        raise AddressError(f"{uri}: ir = {values['ir']!r} must be 0 or 1")
    if not re.fullmatch(r"[1-9]\d{0,2}", values["fps"]):
        raise AddressError(f"{uri}: fps = {values['fps']!r} must be a whole number from 1 to 999")
    return Address(
        uri=uri,
        serial=parts.netloc,
        depth=_size(uri, "depth", values["depth"]),
        color=None if values["color"] == "0" else _size(uri, "color", values["color"]),
        fps=int(values["fps"]),
        ir=values["ir"] == "1",
        recording=Path(values["recording"]) if values["recording"] else None,
    )


def _size(uri: str, key: str, text: str) -> tuple[int, int]:
    match = _SIZE.fullmatch(text)
    if match is None:
        raise AddressError(f"{uri}: {key} = {text!r} must be a width and a height [px], such as 640x480")
    return int(match[1]), int(match[2])
