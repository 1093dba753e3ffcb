"""A bus on which only valid messages arrive."""

from collections.abc import Callable
from typing import Self

from abs_service.bus.contract import Bus, Sample, Subscription
from abs_service.bus.health import Health, Level
from abs_service.wire.edge import Edge


class CheckedBus:
    """Passes on received messages that `Edge` admits, and all sent ones; implements `contract.Bus`.

    Args:
        bus: the bus; closed with this one.
        clock: CLOCK_MONOTONIC [ns].
        certificate: says what is wrong with that of this process; "" if nothing is.

    Attributes:
        trouble: refusals between the last two calls of `report`; "" if there were none.
    """

    def __init__(self, bus: Bus, clock: Callable[[], int], certificate: Callable[[], str] = str) -> None:
        self._bus, self._certificate = bus, certificate
        self._edge = Edge(clock)
        self._reported = 0
        self.trouble = ""
        self.publisher, self.latched_publisher = bus.publisher, bus.latched_publisher
        self.answer_queries = bus.answer_queries
        self.answer_commands = bus.answer_commands  # not checked, since each command gets an answer
        self.declare_liveliness, self.watch_liveliness = bus.declare_liveliness, bus.watch_liveliness
        self.close = bus.close

    def report(self, health: Health) -> None:
        """Adds refusals and certificate to the health of the process; call it before `Health.tick`."""
        refused = self._edge.refused
        health.count_up_to(refused, "refused.")
        total = sum(refused.values())
        new, self._reported = total - self._reported, total
        self.trouble = f"refused {new} messages, the last: {self._edge.last_error}" if new else ""
        health.report("refused", Level.WARNING if new else Level.OK, self.trouble)
        health.report("certificate", Level.WARNING if (trouble := self._certificate()) else Level.OK, trouble)

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """See `contract.Bus.query`."""
        return [sample for sample in self._bus.query(pattern, timeout_s) if self._edge.admits(sample)]

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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
