"""Ages of estimates, also of those of another host, whose clock is not this one's."""

import threading
from collections import deque
from collections.abc import Callable

from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState

#: Period in which the clock of the cameras' host is read [ns], and readings of which the best counts.
PERIOD_NS = 5_000_000_000
READINGS = 12
#: Most that the clocks of two hosts drift apart, as the service assumes.
DRIFT = 500e-6


class Ages:
    """Reads the clock of the cameras' host over the bus; the error of a reading is at most half of its round trip.

    The error grows with the reading's age, as the clocks drift: after a long pause, old readings no longer count.

    Args:
        clock: this host's monotonic clock [ns].
        ask: asks the host of a clock for its time and returns at once; the answers go to `add`.
    """

    def __init__(self, clock: Callable[[], int], ask: Callable[[str], None]) -> None:
        self._clock = clock
        self._ask = ask
        self._lock = threading.Lock()
        self._host_clock = ""
        self._requested_ns = 0
        self._readings: deque[tuple[int, int, int]] = deque(maxlen=READINGS)  # when asked, round trip, offset

    def age_s(self, state: DeformationState, arrived_ns: int) -> float:
        """Time since the exposure [s]; its lower bound if the clock is not known yet.

        Args:
            state: the estimate.
            arrived_ns: arrival on this host's clock.
        """
        now_ns = self._clock()
        self._ask_if_due(state.header.host_clock, now_ns)
        if (offset_ns := self._offset_ns(now_ns)) is not None:
            return max(now_ns - state.header.t_host_ns - offset_ns, 0) * 1e-9
        published_s = state.age_ms * 1e-3 if state.age_ms >= 0 else 0.0  # NaN is not
        return published_s + (now_ns - arrived_ns) * 1e-9

    def add(self, reading: Header) -> None:
        """The time of a clock has arrived."""
        now_ns = self._clock()
        with self._lock:
            if reading.host_clock == self._host_clock:
                middle_ns = (self._requested_ns + now_ns) // 2
                self._readings.append((self._requested_ns, now_ns - self._requested_ns, middle_ns - reading.t_host_ns))

    def _offset_ns(self, now_ns: int) -> int | None:
        with self._lock:
            errors = [
                (round_trip_ns / 2 + DRIFT * (now_ns - requested_ns), offset_ns)
                for requested_ns, round_trip_ns, offset_ns in self._readings
            ]
        return min(errors)[1] if errors else None

    def _ask_if_due(self, host_clock: str, now_ns: int) -> None:
        with self._lock:
            is_new = host_clock != self._host_clock
            if is_new:
                self._host_clock = host_clock
                self._readings.clear()
            if not host_clock or not (is_new or now_ns - self._requested_ns > PERIOD_NS):
                return
            self._requested_ns = now_ns
        self._ask(host_clock)
