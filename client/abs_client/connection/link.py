"""The connection to a rig: a zenoh session of a client, and the threads that receive on it."""

import re
import threading
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, Self

import zenoh

from abs_client.connection import shared_memory
from abs_client.connection.received import Received
from abs_client.connection.session import opened
from abs_client.connection.tls import Tls
from abs_client.connection.wake import Wake
from abs_client.errors import MalformedError, UnknownNameError, UnreachableError

#: Default address at which a rig listens.
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
#: By when a query must be answered [s].
QUERY_S = 2.0
#: Messages of one topic that may wait for their thread; the oldest goes first.
WAITING = 4
#: By when receiving threads have ended after their session has [s].
END_S = 2.0

_LIVE = "live/track/"
_ENDPOINT = re.compile(r"(tcp|tls|quic|udp|ws)/[^?#]+:\d{1,5}(#\S+)?")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


class Link:
    """A client's session with a rig. Ends with `close`, with a `with` block, or at the latest when the program does.

    Args:
        endpoint: `bus.endpoint` of the rig.
        rig: its name.
        tls: for a rig with `[bus.tls]`.

    Attributes:
        rig: its name.
        malformed: messages that could not be read, by key; they are left out.

    Raises:
        UnknownNameError: `endpoint` or `rig` cannot be one.
        UnreachableError: nothing answers there.
    """

    def __init__(self, endpoint: str, rig: str, tls: Tls | None = None) -> None:
        if not _ENDPOINT.fullmatch(endpoint):
            raise UnknownNameError(f"{endpoint!r} is no endpoint: write PROTOCOL/HOST:PORT, such as {DEFAULT_ENDPOINT}")
        self.rig = checked(rig)
        self.malformed: Counter[str] = Counter()
        # Reentrant: the collector may end the link in a thread that holds it, and so may a signal's handler.
        self._lock = threading.RLock()
        self._threads: list[threading.Thread] = []
        self._waiting: weakref.WeakSet[Wake] = weakref.WeakSet()
        self._session = opened(endpoint, tls)
        self._end = weakref.finalize(self, _end, self._session, self._lock, self._threads)

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return not self._end.alive

    def wake_at_end(self, wake: Wake) -> None:
        """Signals `wake` when the link is closed, so that no thread waits for it any more."""
        with self._lock:
            self._waiting.add(wake)

    def subscribe(self, topic: str, on_message: Callable[[Received], None]) -> Callable[[], None]:
        """Calls `on_message`, which must not hold this link, from a thread of its own for the messages of a topic.

        Returns:
            What ends it; to be called once.
        """
        with self._opened():
            channel = zenoh.handlers.RingChannel(WAITING)
            subscriber = self._session.declare_subscriber(self.key(topic), channel)
        self._start(_receive, subscriber, on_message)
        return partial(_undeclare, subscriber)

    def ask(self, topic: str, on_message: Callable[[Received], None]) -> None:
        """Asks for a topic and returns at once; `on_message` is called from another thread for each answer."""
        key = self.key(topic)
        self._start(_receive_answers, lambda: self._session.get(key, timeout=QUERY_S), on_message)

    def query(self, topic: str, payload: bytes | None = None, message: str = "") -> list[Received]:
        """The answers to a query; none after `QUERY_S` without one.

        Args:
            topic: what is asked for.
            payload, message: of a command: the message and its full name.
        """
        details: dict[str, Any] = {"payload": payload, "encoding": f"application/protobuf;{message}"} if message else {}
        with self._opened():
            answers = self._session.get(self.key(topic), target=zenoh.QueryTarget.ALL, timeout=QUERY_S, **details)
            return [_received(answer.ok) for answer in answers if answer.ok is not None]

    def tokens(self, topic: str) -> list[str]:
        """Keys of the liveliness tokens there are."""
        with self._opened():
            answers = self._session.liveliness().get(self.key(topic), timeout=QUERY_S)
            return [str(answer.ok.key_expr) for answer in answers if answer.ok is not None]

    def trackers(self) -> set[str]:
        """Names of the trackers that live."""
        prefix = self.key(_LIVE)
        return {key.removeprefix(prefix) for key in self.tokens(f"{_LIVE}*")}

    def ask_living(self, on_message: Callable[[Received], None]) -> None:
        """Asks for the trackers of all rigs and returns at once; a message of each has the key of its token."""
        tokens = f"abs/*/{_LIVE}*"
        self._start(_receive_answers, lambda: self._session.liveliness().get(tokens, timeout=QUERY_S), on_message)

    def key(self, topic: str) -> str:
        """The zenoh key of a topic of the rig."""
        return f"abs/{self.rig}/{topic}"

    def close(self) -> None:
        """Ends the session and all that receives on it; may be called again."""
        self._end()
        with self._lock:
            waiting = list(self._waiting)
        for wake in waiting:
            wake.signal()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @contextmanager
    def _opened(self) -> Iterator[None]:
        # Looked at afterwards: a question that the end cuts off has no answers, as if nobody had any.
        error = None
        if not self.closed:
            try:
                yield
            except zenoh.ZError as raised:
                error = raised
        if self.closed or error is not None:
            raise UnreachableError("the connection to the rig was closed") from error

    def _start(self, receive: Callable[..., None], source: Any, on_message: Callable[[Received], None]) -> None:
        # A daemon, because the interpreter waits for all others before it calls what would end them.
        take = partial(_take, on_message, self.malformed, self._lock)
        thread = threading.Thread(target=receive, args=(source, take), name="abs_client", daemon=True)
        with self._lock:
            if self.closed:  # nobody would wait for its end
                return
            thread.start()
            self._threads[:] = [*filter(threading.Thread.is_alive, self._threads), thread]


def checked(name: str) -> str:
    """Returns the name of a rig, tracker, sensor or stream if it can be one.

    Raises:
        UnknownNameError: it cannot.
    """
    if not _NAME.fullmatch(name):
        raise UnknownNameError(f"{name!r} is no name: 1 to 64 letters, digits, - and _, the first a letter or digit")
    return name


def _undeclare(subscriber: Any) -> None:
    with suppress(zenoh.ZError):  # its session has ended before
        subscriber.undeclare()


def _receive(subscriber: Any, on_sample: Callable[[zenoh.Sample], None]) -> None:
    with suppress(zenoh.ZError):  # the session has ended
        for sample in subscriber:
            on_sample(sample)


def _receive_answers(ask: Callable[[], Any], on_sample: Callable[[zenoh.Sample], None]) -> None:
    with suppress(zenoh.ZError):
        for answer in ask():
            if answer.ok is not None:
                on_sample(answer.ok)


def _take(
    on_message: Callable[[Received], None], malformed: Counter[str], lock: threading.RLock, one: zenoh.Sample
) -> None:
    try:
        on_message(_received(one))
    except MalformedError:
        with lock:
            malformed[str(one.key_expr)] += 1


def _received(sample: zenoh.Sample) -> Received:
    payload, attachment, key = shared_memory.copied(sample.payload), sample.attachment, str(sample.key_expr)
    if payload is None:
        raise MalformedError(f"{key}: another message was in its memory before it was read")
    return Received(key, payload, attachment.to_bytes() if attachment else b"")


def _end(session: zenoh.Session, lock: threading.RLock, threads: list[threading.Thread]) -> None:
    # Threads that return from zenoh into an interpreter that has ended would abort the process.
    session.close()
    with lock:
        running = list(threads)
    for thread in running:
        if thread is not threading.current_thread():
            thread.join(END_S)
