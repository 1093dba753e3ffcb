"""Detects that a tracker no longer publishes, whatever the cause."""

from collections import deque
from collections.abc import Callable
from statistics import median

#: Time without an estimate after which a tracker is silent: the longer of a number of its periods and a time [ns].
PERIODS, SILENCE_NS = 15, 1_000_000_000
#: Longest time until the first estimate, in which devices open [ns].
FIRST_NS = 10_000_000_000
#: A longer time between two calls of `check` was a stop of this process, without messages [ns].
PAUSE_NS = 3_000_000_000


class SilenceMonitor:
    """Compares the time since the last estimate with the period of the latest ones.

    Args:
        clock: CLOCK_MONOTONIC [ns].
        first_ns: longest time until the first estimate [ns].

    Attributes:
        found: what `check` has said last.
    """

    def __init__(self, clock: Callable[[], int], first_ns: float = FIRST_NS) -> None:
        self._clock = clock
        self._latest_ns = self._checked_ns = clock()
        self._limit_ns = first_ns
        self._periods_ns: deque[int] = deque(maxlen=9)
        self._begun = False
        self.found = ""

    def add(self) -> None:
        """Notes an estimate."""
        now_ns = self._clock()
        if self._begun:
            self._periods_ns.append(now_ns - self._latest_ns)
            self._limit_ns = max(PERIODS * median(self._periods_ns), SILENCE_NS)
        self._begun = True
        self._latest_ns = now_ns

    def check(self) -> str:
        """Says for how long there has been no estimate; "" if that is not too long."""
        now_ns = self._clock()
        paused_ns, self._checked_ns = now_ns - self._checked_ns, now_ns
        if paused_ns > PAUSE_NS:
            self._latest_ns += paused_ns
        silent_ns = now_ns - self._latest_ns
        self.found = f"no estimate for {silent_ns / 1e9:.0f} s" if silent_ns > self._limit_ns else ""
        return self.found
