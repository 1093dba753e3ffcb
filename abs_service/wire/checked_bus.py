"""A bus on which only valid messages arrive."""

from collections.abc import Callable
from typing import Self

from abs_service.bus.contract import Bus, Publisher, Qos, Sample, Subscription
from abs_service.bus.health import Health, Level
from abs_service.wire.edge import Edge


class CheckedBus:
    """Passes on received messages that `Edge` admits, and all sent ones; implements `contract.Bus`.

    Args:
        bus: the bus; closed with this one.
        clock: CLOCK_MONOTONIC [ns].

    Attributes:
        trouble: refusals between the last two calls of `report`; "" if there were none.
    """

    def __init__(self, bus: Bus, clock: Callable[[], int]) -> None:
        self._bus = bus
        self._edge = Edge(clock)
        self._reported = 0
        self.trouble = ""

    def report(self, health: Health) -> None:
        """Adds the refusals to the health of the process; call it before `Health.tick`."""
        refused = self._edge.refused
        health.count_up_to(refused, "refused.")
        total = sum(refused.values())
        new, self._reported = total - self._reported, total
        self.trouble = f"refused {new} messages, the last: {self._edge.last_error}" if new else ""
        health.report("refused", Level.WARNING if new else Level.OK, self.trouble)

    def publisher(self, topic: str, message: str, qos: Qos) -> Publisher:
        """See `contract.Bus.publisher`."""
        return self._bus.publisher(topic, message, qos)

    def latched_publisher(self, topic: str, message: str) -> Publisher:
        """See `contract.Bus.latched_publisher`."""
        return self._bus.latched_publisher(topic, message)

    def answer_queries(self, topic: str, message: str, payload: Callable[[], bytes]) -> Subscription:
        """See `contract.Bus.answer_queries`."""
        return self._bus.answer_queries(topic, message, payload)

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """See `contract.Bus.query`."""
        return [sample for sample in self._bus.query(pattern, timeout_s) if self._edge.admits(sample)]

    def answer_commands(self, topic: str, message: str, answer: Callable[[Sample], bytes]) -> Subscription:
        """See `contract.Bus.answer_commands`; the commands are not checked, since each one gets an answer."""
        return self._bus.answer_commands(topic, message, answer)

    def command(self, topic: str, message: str, payload: bytes, timeout_s: float) -> list[Sample]:
        """See `contract.Bus.command`."""
        answers = self._bus.command(topic, message, payload, timeout_s)
        return [sample for sample in answers if self._edge.admits(sample)]

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Subscription:
        """See `contract.Bus.subscribe`."""

        def on_any(sample: Sample) -> None:
            if self._edge.admits(sample):
                on_sample(sample)

        return self._bus.subscribe(pattern, on_any)

    def declare_liveliness(self, component: str) -> Subscription:
        """See `contract.Bus.declare_liveliness`."""
        return self._bus.declare_liveliness(component)

    def watch_liveliness(self, on_change: Callable[[str, bool], None]) -> Subscription:
        """See `contract.Bus.watch_liveliness`."""
        return self._bus.watch_liveliness(on_change)

    def close(self) -> None:
        """See `contract.Bus.close`."""
        self._bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
