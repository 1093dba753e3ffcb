"""Parts of addresses `scheme://SERIAL?key=value&…`; `address_values` has the parsers of values."""

from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import SplitResult, parse_qsl, urlsplit

from drivers.contract.errors import AddressError


def split(uri: str) -> SplitResult:
    """The parts of an address.

    Raises:
        AddressError: it has none, such as `oak://[`.
    """
    try:
        return urlsplit(uri)
    except ValueError as error:
        raise AddressError(f"{uri}: {error}") from error


def name(uri: str, what: str = "a serial number") -> str:
    """The part before the '?' of an address: `what` of the device, "" for the only one.

    Raises:
        AddressError: something else stands there.
    """
    parts = split(uri)
    if parts.path.strip("/"):
        raise AddressError(f"{uri}: {what} is all that may stand before the '?'")
    return parts.netloc


def with_name(uri: str, device: str) -> str:
    """An address with this name before the '?': what opens the same device again, on any port."""
    parts = split(uri)
    return f"{parts.scheme}://{device}" + (f"?{parts.query}" if parts.query else "")


def values(uri: str, parsers: Mapping[str, Callable[[str], Any]]) -> dict[str, Any]:
    """Values of the keys behind the '?' of an address.

    Raises:
        AddressError: unknown keys, keys that are given twice, and values that are not allowed; names all, and what is.
    """
    found: dict[str, Any] = {}
    mistakes = []
    for key, text in parse_qsl(split(uri).query, keep_blank_values=True):
        if key not in parsers:
            mistakes.append(f"unknown key {key!r}; allowed are {', '.join(sorted(parsers))}")
        elif key in found:
            mistakes.append(f"{key} is given twice")
        else:
            try:
                found[key] = parsers[key](text)
            except ValueError as error:
                mistakes.append(f"{key} = {text!r} must be {error}")
    if mistakes:
        raise AddressError(f"{uri}: {'; '.join(mistakes)}")
    return found
