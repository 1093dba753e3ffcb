"""Interface of the message transport. `ZenohBus` implements it between processes, the tests within one process."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class Priority(StrEnum):
    """Transmission priority of a message; names and order are zenoh's."""

    REAL_TIME = "REAL_TIME"
    DATA_HIGH = "DATA_HIGH"
    DATA = "DATA"
    DATA_LOW = "DATA_LOW"


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a topic. Publishers never block: on congestion, messages are dropped.

    Attributes:
        priority: transmission priority.
        express: do not wait for a batch to fill.
        history: past messages that a late subscriber may request.
    """

    priority: Priority
    express: bool = False
    history: int = 0


STATE = Qos(Priority.REAL_TIME, express=True, history=10)
MESH = Qos(Priority.DATA_HIGH)
EVENTS = Qos(Priority.DATA)
IMAGES = Qos(Priority.DATA_LOW)


@dataclass(frozen=True, slots=True)
class Sample:
    """A received message.

    Attributes:
        topic: key below the rig.
        message: full name of its protobuf type, "" if the publisher gave none.
        payload: the message.
        attachment: bytes sent along with it; b"" if there are none.
        overwritten: whether the message was lost as it was read: another one was in its shared memory already.
    """

    topic: str
    message: str
    payload: bytes
    attachment: bytes = b""
    overwritten: bool = False

    @property
    def size(self) -> int:
        """Approximate size in memory [bytes]."""
        return len(self.payload) + len(self.attachment) + 200


class Publisher(Protocol):
    """Sends the messages of one topic. Safe to use from several threads; never blocks for long."""

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        """Sends one message."""
        ...


class Subscription(Protocol):
    """A declaration on a bus that can be undone; closing the bus undoes all."""

    def close(self) -> None:
        """Undoes the declaration; may be called again."""
        ...


class Bus(Protocol):
    """Topics of one rig, as seen by one process."""

    def publisher(self, topic: str, message: str, qos: Qos) -> Publisher:
        """A publisher of messages of type `message` on `topic`."""
        ...

    def latched_publisher(self, topic: str, message: str) -> Publisher:
        """Publisher that also answers queries with its last message; for data that changes rarely."""
        ...

    def answer_queries(self, topic: str, message: str, payload: Callable[[], bytes]) -> Subscription:
        """Answers queries for `topic`; `payload` is called for each, from a thread of the transport."""
        ...

    def answer_commands(self, topic: str, message: str, answer: Callable[[Sample], bytes]) -> Subscription:
        """Answers commands, which are queries with a payload; `answer` is called for each, from the transport's thread.

        Args:
            topic: of the commands.
            message: full name of the answers' type.
            answer: from a command to its answer.
        """
        ...

    def command(self, topic: str, message: str, payload: bytes, timeout_s: float) -> list[Sample]:
        """All answers to a command of type `message`; empty at once if `topic` has no receiver."""
        ...

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """All answers to a query for the topics that match; empty at once if there is no queryable."""
        ...

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Subscription:
        """Calls `on_sample`, from a thread of the transport, for each message on matching topics; it must be quick."""
        ...

    def declare_liveliness(self, component: str) -> Subscription:
        """Declares a liveliness token, valid until the process ends, cleanly or not."""
        ...

    def watch_liveliness(self, on_change: Callable[[str, bool], None]) -> Subscription:
        """Calls `on_change(component, alive)` for every live component, and at every change."""
        ...

    def close(self) -> None:
        """Ends the session, in a second whatever a callback does; must happen before the interpreter exits."""
        ...
