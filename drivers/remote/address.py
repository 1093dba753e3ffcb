"""Addresses `remote://HOST:PORT/RIG?key=value`."""

from dataclasses import dataclass

from drivers.contract.address import split, values
from drivers.contract.address_values import number, one_of, switch
from drivers.contract.device import AddressError

DEFAULT_PORT = 7447


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Attributes:
        host, port: endpoint of the zenoh router.
        rig: name of the rig, "" for the only one.
        protocol: zenoh's, such as `tcp` and `tls`.
        shared_memory: True if images on one host use shared memory.
        learn_s: time in which streams are observed before opening [s].
        sensors: names of the requested sensors, () for all in the rig's configuration.
    """

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    rig: str = ""
    protocol: str = "tcp"
    shared_memory: bool = True
    learn_s: float = 1.0
    sensors: tuple[str, ...] = ()

    @property
    def endpoint(self) -> str:
        """Endpoint in zenoh's notation."""
        return f"{self.protocol}/{_bracketed(self.host)}:{self.port}"

    def uri(self, rig: str) -> str:
        """Address of a rig at this endpoint."""
        keys = [
            f"protocol={self.protocol}" if self.protocol != Address.protocol else "",
            "" if self.shared_memory else "shared_memory=0",
            f"learn={self.learn_s:g}" if self.learn_s != Address.learn_s else "",
            f"sensors={','.join(self.sensors)}" if self.sensors else "",
        ]
        query = "&".join(filter(None, keys))
        return f"remote://{_bracketed(self.host)}:{self.port}/{rig}" + (f"?{query}" if query else "")


def parse(uri: str) -> Address:
    """Parses an address such as `remote://192.168.1.7:7447/bench`.

    Raises:
        AddressError: invalid host, port, rig or key; names it and the allowed values.
    """
    parts = split(uri)
    rig = parts.path.strip("/")
    try:
        port = DEFAULT_PORT if parts.port is None else parts.port
    except ValueError:
        raise AddressError(f"{uri}: the port must be a number from 1 to 65535") from None
    if set(rig) & set("/*$?#"):
        raise AddressError(f"{uri}: {rig!r} is no name of a rig; write remote://HOST:PORT/RIG")
    given = {_FIELDS.get(key, key): value for key, value in values(uri, _KEYS).items()}
    return Address(parts.hostname or Address.host, port, rig, **given)


def _names(text: str) -> tuple[str, ...]:
    names = tuple(text.split(","))
    if not all(names):
        raise ValueError("names of sensors with commas in between")
    return names


_KEYS = {
    "protocol": one_of("tcp", "tls", "quic", "udp", "ws"),
    "shared_memory": switch,
    "learn": number(float, 0.1, 60),
    "sensors": _names,
}
_FIELDS = {"learn": "learn_s"}


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
