"""Addresses `kinect1://serial?streams=depth,color`."""

from dataclasses import dataclass

from drivers.contract.address import name, values
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
    return Address(name(uri), **values(uri, {"streams": _streams}))


def _streams(text: str) -> tuple[Stream, ...]:
    names = text.split(",")
    known = set(names) <= set(Stream)
    if not known or len(set(names)) < len(names) or {Stream.COLOR, Stream.IR} <= set(names):
        raise ValueError(
            "some of depth, color and ir with commas in between, each once; "
            "color and ir share a pipe, so only one of the two"
        )
    return tuple(map(Stream, names))
