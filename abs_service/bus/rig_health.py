"""Queries the rigs at an endpoint: the health of every component, and components that send none."""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress

import zenoh
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.security.mutual_tls import NO_SECURITY, MutualTls, NoSecurity
from abs_service.bus.session import ENDPOINT_KEY, SessionMode, open_session
from drivers.encoding.message_check import parse_valid
from drivers.encoding.message_content import MessageError

#: Timeout of the connection [ms].
CONNECT_MS = 1000
#: Time in which each component that works publishes its health, which it does once a second [s].
PATIENCE_S = 1.5

_POLL_S = 0.02

#: Health by rig and component; None of a component that is there and sent none in time.
RigHealth = dict[str, dict[str, Health | None]]
#: Components that have to speak, too, by the health of those that are known.
Expected = Callable[[Mapping[str, Health | None]], Iterable[str]]


def ask(
    endpoint: str,
    rig: str = "*",
    security: NoSecurity | MutualTls = NO_SECURITY,
    expected: Expected = lambda _: (),
    key: str = ENDPOINT_KEY,
) -> RigHealth:
    """Listens until every component has published its health, but no longer than `PATIENCE_S`.

    Args:
        endpoint: where `abs-service run` listens.
        rig: name of the rig; `*` for every rig there.
        security: of its bus.
        expected: see `Expected`.
        key: see `open_session`.

    Raises:
        BusError: the endpoint is malformed, or nothing answers there within `CONNECT_MS`.
        TlsError: a file of `security` cannot be used.
    """
    health: RigHealth = {}
    with (
        open_session(endpoint, SessionMode.CLIENT, False, CONNECT_MS, security, key=key) as session,
        session.declare_subscriber(keys.key(rig, keys.health("**"))) as subscriber,
    ):
        deadline_s = time.monotonic() + PATIENCE_S
        for reply in session.liveliness().get(keys.key(rig, keys.live("**")), timeout=PATIENCE_S):
            if reply.ok is not None:
                _note(reply.ok, None, health)
        while time.monotonic() < deadline_s and not _complete(health, expected):
            while (sample := subscriber.try_recv()) is not None:
                _take(sample, health)
            time.sleep(_POLL_S)
    return health


def _complete(health: RigHealth, expected: Expected) -> bool:
    return bool(health) and all(
        None not in components.values() and set(expected(components)) <= components.keys()
        for components in health.values()
    )


def _take(sample: zenoh.Sample, health: RigHealth) -> None:
    # One that is not valid is a stranger's; the component's own follows, or its silence is reported.
    with suppress(MessageError):
        _note(sample, parse_valid(Health, sample.payload.to_bytes()), health)


def _note(sample: zenoh.Sample, own: Health | None, health: RigHealth) -> None:
    # abs/<rig>/health/<component> and abs/<rig>/live/<component>; keys with wildcards, or fewer parts, are strangers'
    key = str(sample.key_expr)
    parts = key.split("/", 3)
    if len(parts) == 4 and "*" not in key and (own is None or own.component == parts[3]):
        health.setdefault(parts[1], {})[parts[3]] = own
