"""A zenoh client session to the remote rig; the only module of this driver that imports zenoh.

Keys are those of docs/how-to/subscribing.md: `abs/RIG/TOPIC`.
"""

import json
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from drivers.contract.device import DeviceError
from drivers.remote.address import Address
from drivers.zenoh_session import connection, shared_memory
from drivers.zenoh_session.callbacks import from_non_daemon_thread

#: Timeout of queries [s].
ANSWER_S = 3.0

#: Free shared memory without which zenoh does not connect with it [bytes]; what is received needs no room.
MIN_SHARED_BYTES = 1 << 20

#: Callback with topic, payload and attachment of a message, from a zenoh thread; must not block.
OnMessage = Callable[[str, bytes, bytes], None]


class Link:
    """One session with a router."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._declared: list[Any] = []
        self._lock = threading.Lock()

    def rigs(self, timeout_s: float = ANSWER_S) -> list[str]:
        """Names of the rigs with a live capture process."""
        replies = self._session.liveliness().get("abs/*/live/capture", timeout=timeout_s)
        return sorted({str(reply.ok.key_expr).split("/")[1] for reply in replies if reply.ok is not None})

    def query(self, rig: str, pattern: str) -> list[bytes]:
        """Replies to a query for a rig's topics that match a pattern."""
        replies = self._session.get(f"abs/{rig}/{pattern}", target=zenoh.QueryTarget.ALL, timeout=ANSWER_S)
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    def subscribe(self, rig: str, pattern: str, on_message: OnMessage) -> None:
        """Subscribes to a rig's topics that match a pattern, until `unsubscribe`."""
        prefix = f"abs/{rig}/"

        def on_sample(sample: zenoh.Sample) -> None:
            attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
            payload = shared_memory.copied(sample.payload) or b""  # which is no message of a rig: it is counted
            on_message(str(sample.key_expr).removeprefix(prefix), payload, attachment)

        self._keep(lambda: self._session.declare_subscriber(prefix + pattern, on_sample))

    def watch_liveliness(self, rig: str, on_gone: Callable[[], None]) -> None:
        """Calls back when the capture process of a rig ends, cleanly or not, until `unsubscribe`."""

        def on_token(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.DELETE:
                on_gone()

        tokens, key = self._session.liveliness(), f"abs/{rig}/live/capture"
        self._keep(lambda: tokens.declare_subscriber(key, on_token, history=True))

    def unsubscribe(self) -> None:
        """Undeclares all subscriptions."""
        with self._lock:
            declared, self._declared = self._declared, []
        for one in declared:
            one.undeclare()

    def close(self) -> None:
        """Closes the session; idempotent. Required before interpreter exit, where zenoh would hang."""
        self.unsubscribe()
        if not self._session.is_closed():
            self._session.close()

    def _keep(self, declare: Callable[[], Any]) -> None:
        declared = from_non_daemon_thread(declare)
        with self._lock:
            self._declared.append(declared)


def open_link(address: Address, timeout_s: float = ANSWER_S) -> Link:
    """Connects to a router.

    Raises:
        DeviceError: no answer within the timeout.
    """
    settings = {
        "mode": "client",
        "connect": {
            "endpoints": [address.endpoint],
            "timeout_ms": round(timeout_s * 1000),
            "exit_on_failure": True,
            "retry": {**connection.RETRY},
        },
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}, "delay": 0},
        "transport": {
            "unicast": {**connection.UNICAST},
            "link": {"tx": {"lease": connection.LEASE_MS}},
            "shared_memory": {
                "enabled": address.shared_memory
                and shared_memory.free_bytes() >= MIN_SHARED_BYTES
                and shared_memory.may_be_locked()
            },
        },
    }
    zenoh.init_log_from_env_or(connection.LOG_LEVELS)
    try:
        return Link(zenoh.open(zenoh.Config.from_json5(json.dumps(settings))))
    except zenoh.ZError as error:
        silence = (
            f"nothing answers at {address.endpoint} within {timeout_s:g} s; is `abs-service run` running there, or "
            "`abs-service capture` with --listen?"
        )
        raise DeviceError(connection.unresolved(address.endpoint) or silence) from error
