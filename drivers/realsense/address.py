"""Addresses of RealSense cameras: `realsense://`, `realsense://728612070259?fps=60`, `realsense://?recording=FILE.db3`."""

from dataclasses import dataclass
from pathlib import Path

from drivers.contract.address import name, values
from drivers.contract.address_values import file, mode, number

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
    given = {"depth": (640, 480, 0), "color": (640, 480, 0), "ir": True, "confidence": True, **values(uri, _KEYS)}
    fps = given.get("fps", 30)
    width, height, rate_hz = given["depth"]
    depth = width, height, rate_hz or fps
    ir, confidence = (depth if given[key] is True else _at(given[key], depth[2]) for key in ("ir", "confidence"))
    return Address(uri, name(uri), depth, _at(given["color"], fps), ir, confidence, given.get("recording"))


def _at(wanted: Mode | None, rate_hz: int) -> Mode | None:
    """A mode with this rate, unless it has one of its own."""
    return wanted and (*wanted[:2], wanted[2] or rate_hz)


def _color(text: str) -> Mode | None:
    return None if text == "0" else mode(text)


def _beside(text: str) -> Mode | bool | None:
    """Mode of a stream beside depth; True if it is as that of depth."""
    return {"0": None, "1": True}[text] if text in ("0", "1") else mode(text, "0, 1 (as depth) or ")


_KEYS = {
    "depth": mode,
    "color": _color,
    "fps": number(int, 1, 999),
    "ir": _beside,
    "confidence": _beside,
    "recording": file,
}
