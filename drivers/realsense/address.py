"""Addresses of RealSense cameras: `realsense://`, `realsense://728612070259?fps=60`, `realsense://?recording=FILE.db3`."""

import re
from dataclasses import dataclass
from pathlib import Path

from drivers.contract.address import query, serial
from drivers.contract.device import AddressError

_DEFAULTS = {"depth": "640x480", "color": "640x480", "fps": "30", "ir": "1", "confidence": "1", "recording": ""}
_RATE = r"[1-9]\d{0,2}"
_MODE = re.compile(rf"([1-9]\d{{1,3}})x([1-9]\d{{1,3}})(?:@({_RATE}))?")

#: Width and height [px], and images per second.
Mode = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        uri: the address itself.
        serial: serial number, "" for the only camera.
        depth, color, ir, confidence: modes of the streams, None for no such stream; which of them go together is for
            librealsense and the camera to say.
        recording: file of librealsense's recorder, played instead of a camera; None for a camera.
    """

    uri: str
    serial: str
    depth: Mode
    color: Mode | None
    ir: Mode | None
    confidence: Mode | None
    recording: Path | None


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    values, number = query(uri, _DEFAULTS), serial(uri)
    if not re.fullmatch(_RATE, values["fps"]):
        raise AddressError(f"{uri}: fps = {values['fps']!r} must be a whole number from 1 to 999")
    fps = int(values["fps"])
    depth = _mode(uri, "depth", values["depth"], fps)
    return Address(
        uri=uri,
        serial=number,
        depth=depth,
        color=None if values["color"] == "0" else _mode(uri, "color", values["color"], fps),
        ir=_beside(uri, "ir", values["ir"], depth),
        confidence=_beside(uri, "confidence", values["confidence"], depth),
        recording=Path(values["recording"]) if values["recording"] else None,
    )


def _beside(uri: str, key: str, text: str, depth: Mode) -> Mode | None:
    """Mode of a stream that is as depth unless the address says otherwise."""
    if text in {"0", "1"}:
        return depth if text == "1" else None
    return _mode(uri, key, text, depth[2], "0, 1 (as depth) or ")


def _mode(uri: str, key: str, text: str, fps: int, others: str = "") -> Mode:
    match = _MODE.fullmatch(text)
    if match is None:
        what = "a width and a height [px], such as 640x480, with a rate of its own 640x480@60"
        raise AddressError(f"{uri}: {key} = {text!r} must be {others}{what}")
    return int(match[1]), int(match[2]), int(match[3] or fps)
