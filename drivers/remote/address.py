"""Addresses `remote://HOST:PORT/RIG?key=value`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl, urlsplit

from drivers.contract.device import AddressError

DEFAULT_PORT = 7447
PROTOCOLS = ("tcp", "tls", "quic", "udp", "ws")
_LEARN_S = (0.1, 60.0)


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Attributes:
        host, port: endpoint of the zenoh router.
        rig: name of the rig, "" for the only one.
        protocol: one of `PROTOCOLS`.
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
    parts = urlsplit(uri)
    rig = parts.path.strip("/")
    try:
        port = DEFAULT_PORT if parts.port is None else parts.port
    except ValueError:
        raise AddressError(f"{uri}: the port must be a number from 1 to 65535") from None
    if set(rig) & set("/*$?#"):
        raise AddressError(f"{uri}: {rig!r} is no name of a rig; write remote://HOST:PORT/RIG")
    read = {}
    for key, text in parse_qsl(parts.query, keep_blank_values=True):
        if key not in _KEYS:
            raise AddressError(f"{uri}: unknown key {key!r}; allowed are {sorted(_KEYS)}")
        name, reader = _KEYS[key]
        try:
            read[name] = reader(text)
        except ValueError as error:
            raise AddressError(f"{uri}: {key} = {text!r} must be {error}") from None
    return Address(parts.hostname or Address.host, port, rig, **read)


def _protocol(text: str) -> str:
    if text not in PROTOCOLS:
        raise ValueError(f"one of {', '.join(PROTOCOLS)}")
    return text


def _switch(text: str) -> bool:
    if text not in {"0", "1"}:
        raise ValueError("0 or 1")
    return text == "1"


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not _LEARN_S[0] <= value <= _LEARN_S[1]:
        raise ValueError(f"a number from {_LEARN_S[0]:g} to {_LEARN_S[1]:g}")
    return value


def _names(text: str) -> tuple[str, ...]:
    names = tuple(text.split(","))
    if not all(names):
        raise ValueError("names of sensors with commas in between")
    return names


_KEYS: Mapping[str, tuple[str, Callable[[str], object]]] = {
    "protocol": ("protocol", _protocol),
    "shared_memory": ("shared_memory", _switch),
    "learn": ("learn_s", _seconds),
    "sensors": ("sensors", _names),
}


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
