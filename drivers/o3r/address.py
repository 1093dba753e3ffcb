"""Addresses of ifm O3R heads: `o3r://`, `o3r://192.168.0.69`, `o3r://192.168.0.69?head=000000000281`."""

from dataclasses import dataclass
from ipaddress import IPv4Address

from drivers.contract.address import name, split, values
from drivers.contract.device import AddressError

#: TCP port of the processing unit's configuration interface (XML-RPC).
XMLRPC_PORT = 80


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        host: IPv4 address of the processing unit, "" for ifm3d's default: the environment variable IFM3D_IP, or
            192.168.0.69, with which units leave the factory.
        port: TCP port of its configuration interface.
        head: serial number of the camera head, "" for the only one.
    """

    host: str = ""
    port: int = XMLRPC_PORT
    head: str = ""


def parse(uri: str) -> Address:
    """Parses an address.

    Raises:
        AddressError: unknown key, or an invalid host or port; names the allowed values.
    """
    unit, parts = name(uri, "an IPv4 address"), split(uri)
    try:
        host, port = parts.hostname or "", parts.port or XMLRPC_PORT
        if host:
            IPv4Address(host)  # ifm3d looks up no names
    except ValueError as error:
        raise AddressError(f"{uri}: {unit!r} must be an IPv4 address, such as 192.168.0.69") from error
    return Address(host, port, **values(uri, {"head": str}))
