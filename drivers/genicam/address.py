"""Addresses of GenICam cameras: `genicam://`, `genicam://24551234?components=Range,Intensity&format=Coord3D_C16`."""

from dataclasses import dataclass

from drivers.contract.address import name, values
from drivers.contract.address_values import number


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
    components: tuple[str, ...] = ("Range", "Intensity", "Confidence")
    pixel_format: str = ""
    focal_px: float | None = None


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key or invalid value; names both and the allowed values.
    """
    return Address(uri, name(uri), **{_FIELDS[key]: value for key, value in values(uri, _KEYS).items()})


def _components(text: str) -> tuple[str, ...]:
    if "Range" not in (components := tuple(text.split(","))):
        raise ValueError("names of components with commas in between, one of them Range")
    return components


_KEYS = {"components": _components, "format": str, "focal": number(float, 1, 1e5)}
_FIELDS = {"components": "components", "format": "pixel_format", "focal": "focal_px"}
