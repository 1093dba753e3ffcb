"""Offsets between the monotonic clocks of hosts, measured over the bus.

The capture process answers queries with its time. The answer was given at some moment between question and receipt, so
that half of that time is the largest error of the offset: a bound, whatever the network does (D. L. Mills, RFC 5905).
"""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from absmsg.v1.common_pb2 import Header
from google.protobuf.message import DecodeError

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Subscription
from abs_service.bus.stamps import HeaderFactory
from drivers.contract.clock import MAX_DRIFT
from drivers.contract.text import is_name

READING = Header.DESCRIPTOR.full_name
#: Period of the queries, and their timeout [s].
PERIOD_S, TIMEOUT_S = 1.0, 0.5
#: Readings that are kept; the best of them counts.
READINGS = 30
#: Clocks that are measured: those asked for last. A message from the bus must not make us measure more.
CLOCKS = 4


@dataclass(frozen=True, slots=True)
class Offset:
    """Term to add to a time of another clock to convert it to this host's, and its largest error [ns]."""

    ns: int
    error_ns: int


#: Between a clock and itself.
NO_OFFSET = Offset(0, 0)


class ClockOffsets:
    """Measures the offset of every clock that was asked for, whenever `measure` is called.

    Args:
        bus: of the rig.
        clock: CLOCK_MONOTONIC [ns].
        own: which clock that is, see `drivers.contract.host_clock`.
    """

    def __init__(self, bus: Bus, clock: Callable[[], int], own: str) -> None:
        self._bus = bus
        self._clock = clock
        self._own = own
        self._readings: dict[str, deque[tuple[int, Offset]]] = {}  # by clock, the one asked for last at the end
        self._lock = threading.Lock()

    def offset(self, host_clock: str) -> Offset | None:
        """The offset of a clock, see `drivers.contract.host_clock`; None if it is not known yet.

        Only the `CLOCKS` that were asked for last are measured.
        """
        if host_clock in ("", self._own):
            return NO_OFFSET
        with self._lock:
            readings = self._readings.pop(host_clock, deque(maxlen=READINGS))
            self._readings[host_clock] = readings
            if len(self._readings) > CLOCKS:
                del self._readings[next(iter(self._readings))]
            now_ns = self._clock()
            offsets = [Offset(one.ns, one.error_ns + round((now_ns - t_ns) * MAX_DRIFT)) for t_ns, one in readings]
        return min(offsets, key=lambda one: one.error_ns, default=None)

    def measure(self) -> None:
        """Reads the other clocks; takes as long as their answers, `TIMEOUT_S` each at most."""
        with self._lock:
            asked_for = [*filter(is_name, self._readings)]
        for host_clock in asked_for:
            self._measure(host_clock)

    def _measure(self, host_clock: str) -> None:
        before_ns = self._clock()
        samples = self._bus.query(keys.clock(host_clock), TIMEOUT_S)
        after_ns = self._clock()
        for sample in samples:
            try:
                header = Header.FromString(sample.payload)
            except DecodeError:
                continue
            if header.host_clock == host_clock:
                middle_ns = (before_ns + after_ns) // 2
                reading = Offset(middle_ns - header.t_host_ns, (after_ns - before_ns + 1) // 2)
                with self._lock:
                    if host_clock in self._readings:
                        self._readings[host_clock].append((before_ns, reading))

    def measure_until(self, stop: threading.Event) -> None:
        """Measures once a second: the target of a thread."""
        while not stop.wait(PERIOD_S):
            self.measure()


def answer(bus: Bus, headers: HeaderFactory) -> Subscription:
    """Answers `ClockOffsets` of other hosts with the time of this one."""
    return bus.answer_queries(keys.clock(headers.host_clock), READING, lambda: headers.now(0).SerializeToString())
