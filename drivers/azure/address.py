"""Addresses of Azure Kinects: `azure://`, `azure://000123456789?depth=wfov_2x2binned&color=1080p&fps=15`."""

from dataclasses import dataclass

from drivers.azure.calibration import COLOR_MODES, DEPTH_MODES
from drivers.contract.address import name, values
from drivers.contract.address_values import one_of, switch
from drivers.contract.device import AddressError

#: Rates in the order of the SDK's numbers [Hz].
RATES_HZ = (5, 15, 30)
#: Formats of colours in the order of the SDK's numbers. The camera has the first three, the SDK computes the last.
FORMATS = ("MJPG", "NV12", "YUY2", "BGRA")
#: Modes that are too large for the highest rate.
_SLOW = ("WFOV_UNBINNED", "3072P")
#: Formats that the camera has in the smallest size only.
_SMALL = ("NV12", "YUY2")

_KEYS = {
    "depth": one_of("0", *map(str.lower, DEPTH_MODES)),
    "color": one_of("0", *map(str.lower, COLOR_MODES)),
    "amplitude": switch,
    "format": one_of(*map(str.lower, FORMATS)),
    "fps": one_of(*map(str, RATES_HZ)),
}


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        uri: the address itself.
        serial: serial number, "" for the only camera.
        depth: mode of the depth sensor, as in `calibration.DEPTH_MODES`; "" if it is off.
        amplitude: True if the amplitudes (active brightness) beside depth are wanted.
        color: resolution of colours, as in `calibration.COLOR_MODES`; "" for none.
        format: of colours, one of `FORMATS`.
        rate_hz: of all streams, one of `RATES_HZ`.
    """

    uri: str
    serial: str
    depth: str
    amplitude: bool
    color: str
    format: str
    rate_hz: int

    @property
    def is_passive(self) -> bool:
        """True for infra-red without the camera's own light, and without depth."""
        return self.depth == "PASSIVE_IR"


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key, invalid value, or modes that do not go together; names the allowed values.
    """
    given = {"depth": "nfov_unbinned", "color": "720p", "amplitude": True, "format": "mjpg", **values(uri, _KEYS)}
    depth, color = ("" if given[key] == "0" else given[key].upper() for key in ("depth", "color"))
    form = given["format"].upper()
    slow = next((mode for mode in (depth, color) if mode in _SLOW), "")
    rate_hz = int(given.get("fps", "15" if slow else "30"))
    if slow and rate_hz == 30:
        raise AddressError(f"{uri}: fps = 30 is too fast for {slow.lower()}, which has 5 and 15")
    if form in _SMALL and color not in ("", "720P"):
        raise AddressError(f"{uri}: format = {form.lower()!r} is for color=720p; the others have mjpg and bgra")
    if not depth and not color:
        raise AddressError(f"{uri}: depth = '0' and color = '0' leave nothing")
    return Address(uri, name(uri), depth, given["amplitude"], color, form, rate_hz)
