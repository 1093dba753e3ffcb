"""Detects a disk that does not answer, as that of a lost server: a thread that writes to it waits forever."""

from collections.abc import Callable

from abs_service.bus.health import Health, Level

#: Time without an answer of the disk after which it is reported, and after which it is an error [ns].
SAID_NS, ERROR_NS = 1_500_000_000, 10_000_000_000


class DiskStall:
    """Reports that the thread that writes stands still.

    Args:
        health: of the recorder.
        clock: monotonic time [ns].
        waiting: size of the messages that wait [bytes].
    """

    def __init__(self, health: Health, clock: Callable[[], int], waiting: Callable[[], int]) -> None:
        self._health, self._clock, self._waiting = health, clock, waiting
        self._alive_ns = 0

    def alive(self) -> None:
        """Notes that the thread that writes is alive; it calls this at least once a second."""
        self._alive_ns = self._clock()

    def report(self) -> None:
        """Reports; to be called several times a second by another thread."""
        silent_ns = self._clock() - self._alive_ns
        if not self._alive_ns or silent_ns < SAID_NS:
            self._health.report("disk", Level.OK)
            return
        level = Level.ERROR if silent_ns >= ERROR_NS else Level.WARNING
        waits = f"{self._waiting() / 1e6:.0f} MB wait in memory"
        self._health.report("disk", level, f"the disk has not answered for {silent_ns / 1e9:.0f} s; {waits}")
