"""Streams that deliver far fewer images than their device promised, as over a bad cable or a slow port."""

import threading
from collections.abc import Iterator, Mapping

from drivers.contract.capabilities import StreamInfo

#: Time over which images are counted [ns], and the share of the promised rate below which that is reported. A camera
#: that doubles its exposure in the dark halves its rate.
WINDOW_NS, MIN_SHARE = 10_000_000_000, 0.45
#: Longest time between two checks [ns]; after a longer one, this process stood still, and not the camera.
PAUSE_NS = 1_000_000_000


class DeliveryRate:
    """Counts the images of each stream. Thread-safe.

    Args:
        streams: by their keys, with the promised rates.
    """

    def __init__(self, streams: Mapping[tuple[str, str], StreamInfo]) -> None:
        self._streams = streams
        self._counted: dict[tuple[str, str], tuple[int, int]] = {}  # beginning of the window [ns], and images since
        self._checked_ns = 0
        self._lock = threading.Lock()

    def add(self, key: tuple[str, str], now_ns: int) -> None:
        """Notes an image; the first one of a stream begins its window."""
        with self._lock:
            begin_ns, number = self._counted.get(key, (now_ns, -1))
            self._counted[key] = begin_ns, number + 1

    def check(self, now_ns: int) -> Iterator[tuple[tuple[str, str], str]]:
        """Streams whose window is over, and what is reported of each, "" if nothing; to be called often."""
        with self._lock:
            paused, self._checked_ns = now_ns - self._checked_ns > PAUSE_NS, now_ns
            if paused:
                self._counted.clear()
            over = [(key, *one) for key, one in self._counted.items() if now_ns - one[0] >= WINDOW_NS]
            self._counted |= {key: (now_ns, 0) for key, *_ in over}
        for key, begin_ns, number in over:
            rate_hz, promised_hz = number * 1e9 / (now_ns - begin_ns), self._streams[key].rate_hz
            slow = f"{rate_hz:.1f} of {promised_hz:g} images a second; see its cable, its port and its exposure"
            yield key, slow if rate_hz < MIN_SHARE * promised_hz else ""
