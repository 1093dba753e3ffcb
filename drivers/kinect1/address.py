"""Addresses `kinect1://serial?streams=depth,color`."""

from dataclasses import dataclass
from urllib.parse import parse_qsl, urlsplit

from drivers.contract.device import AddressError
from drivers.kinect1.camera import Stream


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Attributes:
        serial: serial number, "" for the only attached camera.
        streams: requested streams; colour and infra-red share an endpoint, so at most one of them.
    """

    serial: str = ""
    streams: tuple[Stream, ...] = (Stream.DEPTH, Stream.COLOR)

    @property
    def uri(self) -> str:
        """The address as text, defaults omitted."""
        query = "" if self.streams == Address.streams else f"?streams={','.join(self.streams)}"
        return f"kinect1://{self.serial}{query}"


def parse(uri: str) -> Address:
    """Parses an address such as `kinect1://`, `kinect1://A00363A01234040A` or `kinect1://?streams=depth,ir`.

    Raises:
        AddressError: unknown key or invalid value; names the allowed values.
    """
    try:
        parts = urlsplit(uri)
    except ValueError as error:
        raise AddressError(f"{uri}: {error}") from error
    given = parse_qsl(parts.query, keep_blank_values=True)
    if parts.path not in {"", "/"}:
        raise AddressError(f"{uri}: nothing may follow the serial number but ?streams=…, not {parts.path!r}")
    if unknown := sorted({key for key, _ in given} - {"streams"}):
        raise AddressError(f"{uri}: unknown key {unknown[0]!r}; allowed is 'streams'")
    if len(given) > 1:
        raise AddressError(f"{uri}: streams is given twice")
    return Address(parts.netloc, *(_streams(uri, text) for _, text in given))


def _streams(uri: str, text: str) -> tuple[Stream, ...]:
    names = text.split(",")
    known = set(names) <= set(Stream)
    if not known or len(set(names)) < len(names) or {Stream.COLOR, Stream.IR} <= set(names):
        raise AddressError(
            f"{uri}: streams = {text!r} must be some of depth, color and ir with commas in between, each once; "
            "color and ir share a pipe, so only one of the two"
        )
    return tuple(Stream(name) for name in names)
