"""Health of a component: counters, gauges, labels and level; published once a second and at every change of level."""

import math
import threading
from collections import Counter
from collections.abc import Mapping
from enum import IntEnum

from absmsg.v1 import health_pb2

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS, Bus
from abs_service.bus.stamps import HeaderFactory
from drivers.contract.text import printable

PERIOD_NS = 1_000_000_000
#: The largest number that a counter holds; drivers count in ways of their own.
MAX_COUNT = 2**64 - 1
#: Beginning of the counter of the images that were published on a topic; the topic follows.
PUBLISHED = "published."


def published(counters: Mapping[str, int]) -> dict[str, int]:
    """Number of published images by topic, of the counters of a health."""
    return {name.removeprefix(PUBLISHED): number for name, number in counters.items() if name.startswith(PUBLISHED)}


class Level(IntEnum):
    """Severity of a condition."""

    OK = 1
    WARNING = 2
    ERROR = 3


class Health:
    """The health of one component.

    Values may be set from any thread. The component's own loop calls `tick`, so that the health of a component that
    hangs stops. A component has several conditions (one per device, say); the worst is its level.

    Args:
        bus: where to publish.
        component: capture, record, run or track/<tracker>.
        headers: makes the message headers; its clock times the period.
    """

    def __init__(self, bus: Bus, component: str, headers: HeaderFactory) -> None:
        self._publisher = bus.publisher(keys.health(component), health_pb2.Health.DESCRIPTOR.full_name, EVENTS)
        self._component = component
        self._headers = headers
        self._counters: Counter[str] = Counter()
        self._gauges: dict[str, float] = {}
        self._labels: dict[str, str] = {}
        self._conditions: dict[str, tuple[Level, str]] = {}
        self._seq = 0
        self._next_ns = headers.clock.monotonic()
        self._rated: dict[str, tuple[int, int]] = {}
        # Reentrant because a change of level publishes while it is held: two threads may not overtake each other.
        self._lock = threading.RLock()

    def count(self, name: str, number: int = 1) -> None:
        """Adds to a counter."""
        with self._lock:
            self._counters[name] += number

    def counted(self, name: str) -> int:
        """Adds one to a counter and returns it."""
        with self._lock:
            self._counters[name] += 1
            return self._counters[name]

    def count_up_to(self, totals: Mapping[str, int], prefix: str = "") -> None:
        """Sets counters to totals counted elsewhere, up to `MAX_COUNT`; smaller ones, of a new epoch, are ignored.

        Names and numbers may be a driver's: one that receivers refuse would cost them the whole health.
        """
        with self._lock:
            for name, total in totals.items():
                key = printable(prefix + name)
                self._counters[key] = min(max(self._counters[key], int(total)), MAX_COUNT)

    def gauge(self, name: str, value: float) -> None:
        """Sets a current value, none if it is not finite; the name ends in its unit."""
        name = printable(name)
        with self._lock:
            if math.isfinite(value):
                self._gauges[name] = value
            else:
                self._gauges.pop(name, None)

    def rate(self, name: str, total: int) -> None:
        """Sets the gauge `name` to the rate [Hz] at which `total` grew since the last call."""
        now_ns = self._headers.clock.monotonic()
        with self._lock:
            then_ns, before = self._rated.get(name, (now_ns, total))
            self._rated[name] = (now_ns, total)
            self._gauges[name] = (total - before) * 1e9 / (now_ns - then_ns) if now_ns > then_ns else 0.0

    def label(self, name: str, value: str) -> None:
        """Sets a text value, such as the file being written or a device's state."""
        with self._lock:
            self._labels[name] = printable(value)

    def report(self, condition: str, level: Level, message: str = "") -> None:
        """Sets one condition; a change of its level is published at once, all else with `tick`."""
        with self._lock:
            before, _ = self._conditions.get(condition, (Level.OK, ""))
            self._conditions[condition] = (level, message)
            if level != before:
                self.publish()

    def withdraw(self, beginning: str) -> None:
        """Sets all conditions whose names begin so to OK: what they were about is gone."""
        with self._lock:
            for condition in [name for name in self._conditions if name.startswith(beginning)]:
                self.report(condition, Level.OK)

    @property
    def level(self) -> Level:
        """Level of the worst condition."""
        with self._lock:
            return max((level for level, _ in self._conditions.values()), default=Level.OK)

    def due(self) -> bool:
        """True if `tick` will publish: the moment to update gauges."""
        return self._headers.clock.monotonic() >= self._next_ns

    def tick(self) -> None:
        """Publishes if the period of one second is over."""
        if self.due():
            # From second to second, not from call to call, unless whole seconds were missed.
            self._next_ns = max(self._next_ns + PERIOD_NS, self._headers.clock.monotonic())
            self.publish()

    def publish(self) -> None:
        """Publishes now."""
        with self._lock:
            level = self.level
            message = health_pb2.Health(
                header=self._headers.now(self._seq),
                component=self._component,
                level=f"LEVEL_{level.name}",
                message=printable(
                    "; ".join(text for rank, text in self._conditions.values() if rank == level and text)
                ),
                counters=self._counters,
                gauges=self._gauges,
                labels=self._labels,
            )
            self._seq += 1
            self._publisher.put(message.SerializeToString())
