"""Addresses of GenICam cameras: `genicam://`, `genicam://24551234?components=Range,Intensity&format=Coord3D_C16`."""

from dataclasses import dataclass

from drivers.contract.address import query, serial
from drivers.contract.device import AddressError

_DEFAULTS = {"components": "Range,Intensity,Confidence", "format": "", "focal": ""}


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        uri: the address itself.
        serial: serial number, "" for the only camera.
        components: images to be sent, by their GenICam names; those that the camera lacks are left out.
        pixel_format: of the distances, by its GenICam name; "" for the smallest one.
        focal_px: focal length of a camera that does not tell its own [px]; None if it does.
    """

    uri: str
    serial: str
    components: tuple[str, ...]
    pixel_format: str
    focal_px: float | None


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    values, number = query(uri, _DEFAULTS), serial(uri)
    components = tuple(values["components"].split(","))
    if "Range" not in components:
        raise AddressError(f"{uri}: components = {values['components']!r} must contain Range")
    return Address(uri, number, components, values["format"], _focal(uri, values["focal"]))


def _focal(uri: str, text: str) -> float | None:
    if not text:
        return None
    try:
        focal_px = float(text)
    except ValueError:
        focal_px = 0.0
    if not 1 <= focal_px <= 1e5:
        raise AddressError(f"{uri}: focal = {text!r} must be a number of pixels from 1 to 100000")
    return focal_px
