"""The bus between processes: zenoh."""

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any, Self

import zenoh
from zenoh import ext

from abs_service.bus import keys, links
from abs_service.bus.contract import EVENTS, Publisher, Qos, Sample, Subscription
from abs_service.bus.security import link_log
from abs_service.bus.security.mutual_tls import NO_SECURITY, MutualTls, NoSecurity
from abs_service.bus.session import ENDPOINT_KEY, SessionMode, open_session
from abs_service.bus.zenoh_session.callbacks import from_non_daemon_thread
from abs_service.bus.zenoh_session.shared_memory import copied

_log = logging.getLogger(__name__)

ENCODING = "application/protobuf"
#: Period in which the last state's number is repeated, so that a subscriber notices a loss [s].
HEARTBEAT_S = 0.5
#: Time that a session has to close; zenoh waits ten seconds for some callbacks [s].
CLOSE_S = 1.0


class ZenohBus:
    """One rig's topics on a zenoh session; implements `contract.Bus`."""

    def __init__(self, session: zenoh.Session, rig: str) -> None:
        self._session = session
        self._rig = keys.check_name(rig)
        self._kept: list[Subscription] = []
        self._links: Subscription = ExitStack()

    @classmethod
    def open(
        cls,
        rig: str,
        endpoint: str,
        mode: SessionMode,
        shared_memory: bool = True,
        security: NoSecurity | MutualTls = NO_SECURITY,
        routers: Sequence[str] = (),
        key: str = ENDPOINT_KEY,
    ) -> Self:
        """Opens a session and a bus on it; arguments and errors as in `open_session`."""
        keys.check_name(rig)  # before there is a session to be closed
        bus = cls(open_session(endpoint, mode, shared_memory, security=security, routers=routers, key=key), rig)
        if mode is SessionMode.CLIENT:
            # Who has been connected without TLS is not refused when its router is gone.
            refusal = security.refusal if security.link else _no_refusal
            on_link = links.RouterLog(endpoint, refusal).on_event
        else:
            on_link = link_log.on_event if security.link else _ignore
        bus._links = bus._keep(from_non_daemon_thread(lambda: links.watch(bus._session, on_link)))
        return bus

    def publisher(self, topic: str, message: str, qos: Qos) -> Publisher:
        """See `contract.Bus.publisher`."""
        settings: dict[str, Any] = {
            "encoding": f"{ENCODING};{message}",
            "priority": getattr(zenoh.Priority, qos.priority),
            "congestion_control": zenoh.CongestionControl.DROP,
            "express": qos.express,
        }
        if not qos.history:
            return _Publisher(self._session.declare_publisher(self._key(topic), **settings))
        return _Publisher(
            ext.declare_advanced_publisher(
                self._session,
                self._key(topic),
                cache=ext.CacheConfig(qos.history),
                sample_miss_detection=ext.MissDetectionConfig(heartbeat=HEARTBEAT_S, sporadic_heartbeat=None),
                publisher_detection=True,
                **settings,
            )
        )

    def latched_publisher(self, topic: str, message: str) -> Publisher:
        """See `contract.Bus.latched_publisher`."""
        return _LatchedPublisher(self.publisher(topic, message, EVENTS), self._session, self._key(topic), message)

    def answer_queries(self, topic: str, message: str, payload: Callable[[], bytes]) -> Subscription:
        """See `contract.Bus.answer_queries`."""
        key = self._key(topic)

        def on_query(query: zenoh.Query) -> None:
            query.reply(key, payload(), encoding=f"{ENCODING};{message}")

        return self._keep(from_non_daemon_thread(lambda: self._session.declare_queryable(key, on_query)))

    def answer_commands(self, topic: str, message: str, answer: Callable[[Sample], bytes]) -> Subscription:
        """See `contract.Bus.answer_commands`."""
        key = self._key(topic)

        def on_query(query: zenoh.Query) -> None:
            if query.payload is None or str(query.key_expr) != key:
                # A query for all topics. Access control does not see a command in a query with wildcards.
                return
            command = Sample(topic, _message(query.encoding), query.payload.to_bytes())
            query.reply(key, answer(command), encoding=f"{ENCODING};{message}")

        return self._keep(from_non_daemon_thread(lambda: self._session.declare_queryable(key, on_query)))

    def command(self, topic: str, message: str, payload: bytes, timeout_s: float) -> list[Sample]:
        """See `contract.Bus.command`."""
        encoding = f"{ENCODING};{message}"
        replies = self._session.get(
            self._key(topic), target=zenoh.QueryTarget.ALL, timeout=timeout_s, payload=payload, encoding=encoding
        )
        return [self._sample(reply.ok) for reply in replies if reply.ok is not None]

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """See `contract.Bus.query`."""
        replies = self._session.get(self._key(pattern), target=zenoh.QueryTarget.ALL, timeout=timeout_s)
        return [self._sample(reply.ok) for reply in replies if reply.ok is not None]

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Subscription:
        """See `contract.Bus.subscribe`."""

        # The bytes are copied here, in zenoh's thread, so that a slow subscriber never holds shared memory.
        def on_zenoh_sample(sample: zenoh.Sample) -> None:
            on_sample(self._sample(sample))

        key = self._key(pattern)
        return self._keep(from_non_daemon_thread(lambda: self._session.declare_subscriber(key, on_zenoh_sample)))

    def declare_liveliness(self, component: str) -> Subscription:
        """See `contract.Bus.declare_liveliness`."""
        return self._keep(self._session.liveliness().declare_token(self._key(keys.live(component))))

    def watch_liveliness(self, on_change: Callable[[str, bool], None]) -> Subscription:
        """See `contract.Bus.watch_liveliness`."""
        prefix = keys.live("")

        def on_token(sample: zenoh.Sample) -> None:
            component = keys.topic(self._rig, str(sample.key_expr)).removeprefix(prefix)
            on_change(component, sample.kind == zenoh.SampleKind.PUT)

        tokens, key = self._session.liveliness(), self._key(keys.live("**"))
        return self._keep(from_non_daemon_thread(lambda: tokens.declare_subscriber(key, on_token, history=True)))

    def close(self) -> None:
        """Ends the session; may be called again. A callback that does not return is left behind after a second."""
        if self._session.is_closed():
            return
        # Not a daemon: it may return from Rust, which a finalized interpreter does not survive.
        closing = threading.Thread(target=self._close_session, name="close bus", daemon=False)
        closing.start()
        closing.join(CLOSE_S)
        if closing.is_alive():
            self._warn_of_callback(f"no answer within {CLOSE_S:g} s")

    def _close_session(self) -> None:
        try:
            self._links.close()  # what it closes itself is no loss
            self._session.close()
        except zenoh.ZError as error:
            self._warn_of_callback(error)

    def _warn_of_callback(self, reason: object) -> None:
        _log.warning("rig %s: the session did not close, a callback has not returned: %s", self._rig, reason)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _keep(self, declared: Any) -> Subscription:
        # zenoh undeclares a token, and possibly others, when Python collects the object, and raises at a second call.
        once = ExitStack()
        once.callback(declared.undeclare)
        self._kept.append(once)
        return once

    def _key(self, topic: str) -> str:
        return keys.key(self._rig, topic)

    def _sample(self, sample: zenoh.Sample) -> Sample:
        payload, attachment, key = copied(sample.payload), sample.attachment, str(sample.key_expr)
        try:
            topic = keys.topic(self._rig, key)
        except keys.KeyNameError:  # with wildcards, say abs/**, which includes topics of the rig
            topic = f"/{key}"  # is none, and will be refused and counted
        return Sample(
            topic,
            _message(sample.encoding),
            payload or b"",
            b"" if attachment is None else attachment.to_bytes(),
            overwritten=payload is None,
        )


def _no_refusal(endpoint: str) -> str:
    return ""


def _ignore(event: zenoh.LinkEvent) -> None:
    pass


def _message(encoding: zenoh.Encoding | None) -> str:
    """Full name of the type of a message; "" if it was not given."""
    return str(encoding).partition(f"{ENCODING};")[2]


class _Publisher:
    def __init__(self, publisher: zenoh.Publisher | ext.AdvancedPublisher) -> None:
        self._publisher = publisher

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        self._publisher.put(payload, attachment=attachment or None)


class _LatchedPublisher:
    """A publisher whose last message answers queries; it answers nothing before the first."""

    def __init__(self, publisher: Publisher, session: zenoh.Session, key: str, message: str) -> None:
        self._publisher = publisher
        self._key = key
        self._message = message
        self._last: bytes | None = None
        self._queryable = from_non_daemon_thread(lambda: session.declare_queryable(key, self._on_query))

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        self._last = payload
        self._publisher.put(payload, attachment)

    def _on_query(self, query: zenoh.Query) -> None:
        if self._last is not None:
            query.reply(self._key, self._last, encoding=f"{ENCODING};{self._message}")
