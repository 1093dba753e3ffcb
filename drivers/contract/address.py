"""Parts of addresses that several drivers share."""

from collections.abc import Mapping
from urllib.parse import parse_qsl, urlsplit

from drivers.contract.errors import AddressError


def serial(uri: str) -> str:
    """The serial number of an address, "" for the only device.

    Raises:
        AddressError: something else before the '?'.
    """
    parts = urlsplit(uri)
    if parts.path.strip("/"):
        raise AddressError(f"{uri}: a serial number is all that may stand before the '?'")
    return parts.netloc


def query(uri: str, defaults: Mapping[str, str]) -> dict[str, str]:
    """Values of all keys of an address: those behind its '?', and defaults.

    Raises:
        AddressError: a key without a default; names the allowed ones.
    """
    values = dict(defaults)
    for key, value in parse_qsl(urlsplit(uri).query, keep_blank_values=True):
        if key not in values:
            raise AddressError(f"{uri}: unknown key {key!r}; allowed are {', '.join(sorted(values))}")
        values[key] = value
    return values
