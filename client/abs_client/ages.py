"""Ages of estimates, also of those of another host, whose clock is not this one's."""

import threading
from collections import deque
from collections.abc import Callable

from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState

#: Period in which the clock of the cameras' host is read [ns], and readings of which the best counts.
PERIOD_NS = 5_000_000_000
READINGS = 12


class Ages:
    """Reads the clock of the cameras' host over the bus; the error of a reading is at most half of its round trip.

    Args:
        clock: this host's monotonic clock [ns].
        ask: asks the host of a clock for its time and returns at once; the answers go to `add`.
    """

    def __init__(self, clock: Callable[[], int], ask: Callable[[str], None]) -> None:
        self._clock = clock
        self._ask = ask
        self._lock = threading.Lock()
        self._host_clock = ""
        self._asked_ns = 0
        self._readings: deque[tuple[int, int]] = deque(maxlen=READINGS)  # round trip, offset [ns]

    def age_s(self, state: DeformationState, arrived_ns: int) -> float:
        """Time since the exposure [s]; the least that it can be if the clock is not known yet.

        Args:
            state: the estimate.
            arrived_ns: arrival on this host's clock.
        """
        now_ns = self._clock()
        self._ask_if_due(state.header.host_clock, now_ns)
        with self._lock:
            offsets = sorted(self._readings)
        if offsets:
            return max(now_ns - state.header.t_host_ns - offsets[0][1], 0) * 1e-9
        published_s = state.age_ms * 1e-3 if state.age_ms >= 0 else 0.0  # NaN is not
        return published_s + (now_ns - arrived_ns) * 1e-9

    def add(self, reading: Header) -> None:
        """The time of a clock has arrived."""
        now_ns = self._clock()
        with self._lock:
            if reading.host_clock == self._host_clock:
                middle_ns = (self._asked_ns + now_ns) // 2
                self._readings.append((now_ns - self._asked_ns, middle_ns - reading.t_host_ns))

    def _ask_if_due(self, host_clock: str, now_ns: int) -> None:
        with self._lock:
            is_new = host_clock != self._host_clock
            if not host_clock or not (is_new or now_ns - self._asked_ns > PERIOD_NS):
                return
            if is_new:
                self._host_clock = host_clock
                self._readings.clear()
            self._asked_ns = now_ns
        self._ask(host_clock)
