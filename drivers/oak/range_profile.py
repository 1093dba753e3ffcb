"""Range profile of a time-of-flight camera over time, for the frames' `modulation`.

An image does not say with which profile it was made, and a change takes effect some exposures after it was sent.
"""

import threading
from collections.abc import Callable

#: Time within which a change has taken effect: the device's queues hold a few exposures [ns].
SETTLING_NS = 500_000_000


class RangeProfile:
    """The profile, and when it was changed. Thread-safe.

    Args:
        first: the profile from the start on.
        clock: CLOCK_MONOTONIC [ns].
    """

    def __init__(self, first: str, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._current = self._before = first
        self._changed_ns, self._settled_ns = 0, 0

    @property
    def current(self) -> str:
        """The profile that was set last."""
        return self._current

    def change(self, profile: str) -> None:
        """Notes that a profile was sent to the device just now."""
        with self._lock:
            if profile == self._current:
                return
            now_ns = self._clock()
            if now_ns >= self._settled_ns:  # else the last change still takes effect, and this one goes on with it
                self._before, self._changed_ns = self._current, now_ns
            self._current, self._settled_ns = profile, now_ns + SETTLING_NS

    def at(self, t_host_ns: int) -> str | None:
        """The profile of an exposure; None while a change takes effect."""
        with self._lock:
            if t_host_ns >= self._settled_ns:
                return self._current
            return self._before if t_host_ns < self._changed_ns else None
