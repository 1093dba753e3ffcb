"""What the service needs of a transport. `ZenohBus` keeps this promise between processes, tests keep it within one."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class Priority(StrEnum):
    """Which of several waiting messages goes first; names and order are zenoh's."""

    REAL_TIME = "REAL_TIME"
    DATA_HIGH = "DATA_HIGH"
    DATA = "DATA"
    DATA_LOW = "DATA_LOW"


@dataclass(frozen=True, slots=True)
class Qos:
    """How a topic travels. Nothing ever blocks the publisher: what the network cannot take is dropped.

    Attributes:
        priority: which messages go first.
        express: do not wait for a batch to fill.
        history: messages that a subscriber who asks for history gets when it arrives late.
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
    """One message as it arrived.

    Attributes:
        topic: key below the rig.
        message: full name of its protobuf type, "" if the publisher did not say.
        payload: the message.
        attachment: what came with it; b"" if nothing did.
    """

    topic: str
    message: str
    payload: bytes
    attachment: bytes = b""

    @property
    def size(self) -> int:
        """Bytes it occupies, about."""
        return len(self.payload) + len(self.attachment) + 200


class Publisher(Protocol):
    """Sends the messages of one topic. Safe to use from several threads; never blocks for long."""

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        """Sends one message."""
        ...


class Subscription(Protocol):
    """Something declared on a bus that can be taken back; closing the bus takes back everything."""

    def close(self) -> None:
        """Takes it back; may be called again."""
        ...


class Bus(Protocol):
    """One rig's topics, as one process sees them."""

    def publisher(self, topic: str, message: str, qos: Qos) -> Publisher:
        """Declares that this process sends messages of type `message` on `topic`."""
        ...

    def latched_publisher(self, topic: str, message: str) -> Publisher:
        """Like `publisher`, for what changes seldom: the last message also answers whoever asks for the topic."""
        ...

    def answer_queries(self, topic: str, message: str, payload: Callable[[], bytes]) -> Subscription:
        """Answers queries for `topic`; `payload` is called for each, from a thread of the transport."""
        ...

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """All answers to a query for the topics that match; empty, at once, if nobody answers."""
        ...

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Subscription:
        """Calls `on_sample`, from a thread of the transport, for each message on matching topics; it must be quick."""
        ...

    def declare_liveliness(self, component: str) -> Subscription:
        """Lets others see that this component runs, until its process ends, cleanly or not."""
        ...

    def watch_liveliness(self, on_change: Callable[[str, bool], None]) -> Subscription:
        """Calls `on_change(component, alive)` for every component there is and whenever one comes or goes."""
        ...

    def close(self) -> None:
        """Ends the session; must happen before the interpreter exits."""
        ...
