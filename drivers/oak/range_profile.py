"""Range profile of a time-of-flight camera over time, for the frames' `modulation`.

An image does not say with which profile it was made, and a change takes effect some exposures after it was sent. Images
of that time are labelled with both profiles, so that a noise calibration takes none of them for one of either.
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
        self._labels = [first]  # in force from the time of the same index on
        self._times_ns = [0]
        self._current = first

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
            while self._times_ns[-1] > now_ns:  # the previous change has not taken effect yet
                self._times_ns.pop()
                self._labels.pop()
            self._labels += [f"{self._labels[-1]} to {profile}", profile]
            self._times_ns += [now_ns, now_ns + SETTLING_NS]
            self._labels, self._times_ns = self._labels[-4:], self._times_ns[-4:]
            self._current = profile

    def at(self, t_host_ns: int) -> str:
        """The profile of an exposure; "low to high" while a change takes effect."""
        with self._lock:
            for label, begin_ns in zip(reversed(self._labels), reversed(self._times_ns)):
                if begin_ns <= t_host_ns:
                    return label
            return self._labels[0]
