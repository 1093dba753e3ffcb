"""A bus within one process, delivered in the publisher's thread: what the contract promises and nothing else."""

import fnmatch
from collections.abc import Callable

from absmsg.v1.health_pb2 import Health as HealthMessage

from abs_service.bus.contract import Publisher, Qos, Sample, Subscription
from abs_service.bus.health import Health


class LoopbackBus:
    """Keeps the promises of `abs_service.bus.contract.Bus` without a network, and remembers every message."""

    def __init__(self):
        self.sent: list[Sample] = []
        self.alive: set[str] = set()
        self._subscribers: list[tuple[str, Callable[[Sample], None]]] = []
        self._commands: dict[str, tuple[str, Callable[[Sample], bytes]]] = {}
        self._answers: dict[str, tuple[str, Callable[[], bytes | None]]] = {}

    def publisher(self, topic: str, message: str, qos: Qos) -> Publisher:
        return _Publisher(self, topic, message)

    def latched_publisher(self, topic: str, message: str) -> Publisher:
        publisher = _Publisher(self, topic, message)
        self._answers[topic] = (message, lambda: publisher.last)
        return publisher

    def answer_queries(self, topic: str, message: str, payload: Callable[[], bytes]) -> Subscription:
        self._answers[topic] = (message, payload)
        return _Closer(lambda: self._answers.pop(topic, None))

    def answer_commands(self, topic: str, message: str, answer: Callable[[Sample], bytes]) -> Subscription:
        self._commands[topic] = (message, answer)
        return _Closer(lambda: self._commands.pop(topic, None))

    def command(self, topic: str, message: str, payload: bytes, timeout_s: float) -> list[Sample]:
        if topic not in self._commands:
            return []
        of_answer, answer = self._commands[topic]
        return [Sample(topic, of_answer, answer(Sample(topic, message, payload)))]

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        found = [
            (topic, message, payload()) for topic, (message, payload) in self._answers.items() if _hit(topic, pattern)
        ]
        return [Sample(topic, message, payload) for topic, message, payload in found if payload is not None]

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Subscription:
        entry = (pattern, on_sample)
        self._subscribers.append(entry)
        return _Closer(lambda: entry in self._subscribers and self._subscribers.remove(entry))

    def declare_liveliness(self, component: str) -> Subscription:
        self.alive.add(component)
        return _Closer(lambda: self.alive.discard(component))

    def watch_liveliness(self, on_change: Callable[[str, bool], None]) -> Subscription:
        for component in self.alive:
            on_change(component, True)
        return _Closer(lambda: None)

    def close(self) -> None:
        self._subscribers.clear()

    def deliver(self, sample: Sample) -> None:
        self.sent.append(sample)
        for pattern, on_sample in list(self._subscribers):
            if _hit(sample.topic, pattern):
                on_sample(sample)


def health_now(health: Health, bus: LoopbackBus) -> HealthMessage:
    """The health as a subscriber would receive it now."""
    health.publish()
    return HealthMessage.FromString([sample for sample in bus.sent if sample.topic.startswith("health/")][-1].payload)


class _Publisher:
    def __init__(self, bus: LoopbackBus, topic: str, message: str):
        self._bus, self._topic, self._message = bus, topic, message
        self.last: bytes | None = None

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        self.last = payload
        self._bus.deliver(Sample(self._topic, self._message, payload, attachment))


class _Closer:
    def __init__(self, action: Callable[[], object]):
        self._action = action

    def close(self) -> None:
        self._action()


def _hit(topic: str, pattern: str) -> bool:
    return fnmatch.fnmatchcase(topic, pattern.replace("**", "*"))
