"""Opens zenoh sessions: explicit endpoints, no discovery, actionable errors."""

import json
import logging
import os
import re
import resource
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import StrEnum

import zenoh

from abs_service.bus.security import expiry
from abs_service.bus.security.mutual_tls import NO_SECURITY, MutualTls, NoSecurity
from abs_service.bus.zenoh_session import connection, shared_memory
from abs_service.bus.zenoh_session.pools import own_size
from drivers.encoding.message_check import MAX_IMAGE_BYTES

_log = logging.getLogger(__name__)

#: Where a rig listens unless it is configured otherwise.
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
#: Key of the rig file that says so.
ENDPOINT_KEY = "bus.endpoint"
#: Timeout of a client's connection to its router [ms].
CONNECT_TIMEOUT_MS = 3000
#: Largest pool of a process; what it has no room for goes through sockets.
SHARED_MEMORY_POOL_BYTES = 32 << 20
#: Pools that have to fit into what is free, so that those of a rig do into the 64 MB that a container has by default.
SHARED_MEMORY_POOLS = 8
#: Free shared memory without which none is used: what zenoh needs beside the pools is 1.3 MB a process.
MIN_SHARED_MEMORY_BYTES = 32 << 20

#: The times that zenoh can write begin in 1970 and are shorter [s]: beyond, each message would end the process.
WALL_CLOCK_S, WALL_CLOCK = 2**32, "zenoh needs one between 1970 and 2106; set it (timedatectl)"

#: Larger messages are refused before they are complete: an image of `message_check.MAX_IMAGE_BYTES` and its attachment.
MAX_MESSAGE_BYTES = MAX_IMAGE_BYTES + (1 << 20)

#: Without zenoh's ?…, which is for several links between two programs: a mistake in it keeps everybody out, or panics.
_ENDPOINT = re.compile(r"(tcp|tls|quic|udp|ws)/(\[[0-9a-fA-F:.]+\]|[^\s:/?#\[\]]+):(?P<port>\d{1,5})(#\S+)?")


#: Lowest levels of zenoh's log, which has refused clients as warnings.
LOG_LEVELS = f"{connection.LOG_LEVELS},zenoh_link_tls=warn"


class BusError(Exception):
    """The bus cannot be opened; the message names the key, its value and the remedy."""


class UnansweredError(BusError, ConnectionError):
    """Nobody answers at the endpoint; who does not yet, or stands still, may do so later."""


class SessionMode(StrEnum):
    """Mode of a session, in zenoh's terms."""

    ROUTER = "router"  # listens on the endpoint; exactly one process of a rig
    CLIENT = "client"  # connects to it


def open_session(
    endpoint: str,
    mode: SessionMode,
    shared_memory: bool = True,
    connect_timeout_ms: int = CONNECT_TIMEOUT_MS,
    security: NoSecurity | MutualTls = NO_SECURITY,
    routers: Sequence[str] = (),
    key: str = ENDPOINT_KEY,
) -> zenoh.Session:
    """Opens a session. Close it before the interpreter exits, or zenoh hangs at exit.

    Args:
        endpoint: where the router listens, such as tcp/127.0.0.1:7447.
        mode: whether to be the router or to connect to it.
        shared_memory: whether large messages pass through shared memory between processes of one host.
        connect_timeout_ms: timeout of a client's connection [ms].
        security: authentication and access rights.
        routers: endpoints of other routers that a router connects to, whenever they are there.
        key: what gave the endpoint, for messages: a key of the rig file, or an option.

    Raises:
        BusError: the endpoint is malformed or in use, its owner refuses this process, or the wall clock is absurd.
        UnansweredError: nothing answers there.
        TlsError: a file of `security` cannot be used.
    """
    if not 0 <= (now_s := time.time()) < WALL_CLOCK_S:
        raise BusError(f"the wall clock is set to {datetime.fromtimestamp(now_s, UTC):%Y-%m-%d}: {WALL_CLOCK}")
    check_endpoint(endpoint, security, key)
    for other in routers:
        check_endpoint(other, security, "bus.routers")
    own = security.check(endpoint, mode is SessionMode.ROUTER)
    if warning := expiry.warning(own):
        _log.warning("%s", warning)
    if not sys.stdout.isatty():
        os.environ.setdefault("NO_COLOR", "1")  # zenoh's lines would have escape sequences
    zenoh.init_log_from_env_or(LOG_LEVELS)
    try:
        settings = _settings(
            endpoint, mode, pool_bytes() if shared_memory else 0, connect_timeout_ms, security, routers
        )
        return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
    except zenoh.ZError as error:
        unresolved = connection.unresolved(endpoint) if mode is SessionMode.CLIENT else ""
        refusal = security.refusal(endpoint) if mode is SessionMode.CLIENT and not unresolved else ""
        kind = UnansweredError if mode is SessionMode.CLIENT and not refusal else BusError
        reason = refusal or unresolved or _explain(str(error), mode, connect_timeout_ms, key)
        raise kind(f'{key} = "{endpoint}": {reason}') from error


def is_endpoint(text: str) -> bool:
    """True for PROTOCOL/HOST:PORT, and #… as zenoh can read it."""
    match = _ENDPOINT.fullmatch(text)
    if match is None or not 1 <= int(match["port"]) <= 65535:
        return False
    try:
        zenoh.Config().insert_json5("connect/endpoints", json.dumps([text]))
    except zenoh.ZError:
        return False
    return True


def check_endpoint(endpoint: str, security: NoSecurity | MutualTls = NO_SECURITY, key: str = ENDPOINT_KEY) -> str:
    """Returns `endpoint`, which `key` names in messages, if it can be one.

    Raises:
        BusError: it cannot.
    """
    if not is_endpoint(endpoint):
        raise BusError(
            f'{key} = "{endpoint}": not an endpoint; write PROTOCOL/HOST:PORT with protocol tcp, tls, quic, udp '
            "or ws and a port from 1 to 65535, such as tcp/127.0.0.1:7447, without ?…"
        )
    if security.link and not endpoint.startswith("tls/"):
        raise BusError(f'{key} = "{endpoint}": must begin with tls/, because there is a table [bus.tls]')
    return endpoint


def _explain(error: str, mode: SessionMode, connect_timeout_ms: int, key: str) -> str:
    if "in use" in error:
        in_file = "set endpoint in the table [bus] of the rig file to another port; `abs-service new` writes a file"
        instead = in_file if key == ENDPOINT_KEY else f"give {key} another port"
        return f"the address is in use; is another abs-service running? Stop it, or {instead}"
    if mode is SessionMode.CLIENT:
        return (
            f"nothing answers there within {connect_timeout_ms / 1000:g} s; start `abs-service run`, or compare host "
            "and port with its bus.endpoint"
        )
    # zenoh appends its own source lines, which are of no use here.
    return "cannot listen there: " + re.sub(r"\s+at /\S+\.rs:\d+\.", "", error)


def pool_bytes() -> int:
    """Size of the pool for images in shared memory [bytes]; 0 if there is no room for those of all processes.

    zenoh makes it when it is needed first, and may lose a connection for ever if it, or a reader, cannot.
    """
    if not shared_memory.may_be_locked():
        _log.info("locked memory is limited (ulimit -l) to too little: images are copied through sockets")
        return 0
    free = shared_memory.free_bytes()
    if free < MIN_SHARED_MEMORY_BYTES:
        _log.warning("%s has %.0f MB free: images are copied through sockets", shared_memory.FOLDER, free * 1e-6)
        return 0
    return own_size(min(SHARED_MEMORY_POOL_BYTES, free // SHARED_MEMORY_POOLS))


def _accept() -> dict[str, int]:
    """Bounds of the connections that have begun and not said yet who they are.

    By default, a hundred that say nothing keep everybody else out for 10 s.
    """
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return {"accept_pending": files // 4, "accept_timeout": connection.UNICAST["open_timeout"]}


def _settings(
    endpoint: str,
    mode: SessionMode,
    pool: int,
    connect_timeout_ms: int,
    security: NoSecurity | MutualTls,
    routers: Sequence[str],
) -> dict[str, object]:
    listens = mode is SessionMode.ROUTER
    return {
        "mode": mode.value,
        "listen": {"endpoints": [endpoint] if listens else []},
        "connect": {
            "endpoints": list(routers) if listens else [endpoint],
            # A rig works without the other routers of a lab, and connects to them when they come back.
            "timeout_ms": -1 if listens else connect_timeout_ms,
            "exit_on_failure": not listens,
            "retry": {**connection.RETRY},
        },
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}, "delay": 0},
        "timestamping": {"enabled": True},  # what caches of late joiners are ordered by
        "transport": {
            "unicast": {**connection.UNICAST, **_accept()},
            "link": {
                "tx": {"lease": connection.LEASE_MS, "queue": connection.QUEUE},
                "rx": {"max_message_size": MAX_MESSAGE_BYTES},
                **security.link,
            },
            "shared_memory": {
                "enabled": pool > 0,
                "transport_optimization": {
                    "enabled": pool > 0,
                    "pool_size": max(1, pool),
                    # Not queries: zenoh may lose those while the receiver stalls (eclipse-zenoh/zenoh #2628).
                    "messages": ["put"],
                },
            },
        },
        **(security.router if listens else {}),
    }
