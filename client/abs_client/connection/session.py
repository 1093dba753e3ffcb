"""A client's session with the router of a rig."""

import json
import socket

import zenoh

from abs_client.connection import refusal, shared_memory
from abs_client.connection.tls import Tls
from abs_client.errors import UnreachableError

#: By when a rig must answer that is connected to [s].
CONNECT_S = 3.0
#: Time between the tries to connect again to a rig that is gone, at first and at most, and the longest of a try [ms].
RETRY_MS, TRY_MS = (250, 1000), 2000


def opened(endpoint: str, tls: Tls | None = None) -> zenoh.Session:
    """A client's session with the router at an endpoint.

    Raises:
        UnreachableError: nothing answers there, its name has no address, or one side refuses the other's certificate.
    """
    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(client_settings(endpoint, tls))))
    except zenoh.ZError as error:
        host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
        try:
            socket.getaddrinfo(host, None)
        except (OSError, UnicodeError) as unresolved:  # an empty part, or one of more than 63 letters
            reason = getattr(unresolved, "strerror", "it is no name")
            raise UnreachableError(f'the name "{host}" in {endpoint} cannot be resolved: {reason}') from error
        if refused := refusal.reason(endpoint, tls):
            raise UnreachableError(f"{endpoint}: {refused}") from error
        raise UnreachableError(f"nothing answers at {endpoint} within {CONNECT_S:g} s: is it running?") from error


def client_settings(endpoint: str, tls: Tls | None = None) -> dict[str, object]:
    """Configuration of zenoh for a client of the router at an endpoint; without certificates if `tls` is None."""
    own = {} if tls is None else {"connect_certificate": str(tls.certificate), "connect_private_key": str(tls.key)}
    link = {"tls": {"root_ca_certificate": str(tls.authority), "enable_mtls": True, **own}} if tls else {}
    return {
        "mode": "client",
        "connect": {
            "endpoints": [endpoint],
            "timeout_ms": round(CONNECT_S * 1000),
            "exit_on_failure": True,
            "retry": {"period_init_ms": RETRY_MS[0], "period_max_ms": RETRY_MS[1]},
        },
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}, "delay": 0},
        "transport": {
            "unicast": {"open_timeout": TRY_MS},
            "link": link,
            "shared_memory": {"enabled": shared_memory.is_usable()},
        },
    }
