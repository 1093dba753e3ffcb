"""A clock that waiting advances, for drivers that have a pace."""

import threading
from collections.abc import Mapping


class ManualTime:
    """Host time [ns]; the k-th wait takes longer than asked for by `delays[k]` [ns]."""

    def __init__(self, now_ns: int, delays: Mapping[int, int] | None = None) -> None:
        self._now_ns = now_ns
        self._delays = delays or {}
        self._waits = 0

    def clock(self) -> int:
        return self._now_ns

    def wait(self, stop: threading.Event, seconds: float) -> bool:
        self._now_ns += round(seconds * 1e9) + self._delays.get(self._waits, 0)
        self._waits += 1
        return stop.is_set()
