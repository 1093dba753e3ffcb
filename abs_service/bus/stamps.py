"""Conversion of monotonic to wall-clock time, and message headers."""

import ctypes
import time
import uuid
from collections.abc import Callable

from absmsg.v1 import common_pb2

from drivers.contract.host_clock import host_clock

#: A larger change of the offset within a second is a step, not slewing [ns].
STEP_NS = 50_000_000

#: What adjtimex(2) says of a clock that follows no time server, and room for the `struct timex` that it fills [bytes].
_TIME_ERROR, _TIMEX_BYTES = 5, 1024


def is_synchronised() -> bool:
    """True if the kernel says that the wall clock follows a time server, see adjtimex(2)."""
    return 0 <= ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES)) < _TIME_ERROR


class WallClock:
    """Maps monotonic to wall-clock time by an offset that is measured, not assumed.

    The stamps of one process are therefore as smooth as its monotonic clock between two calls of `measure`, and a step
    of the wall clock shows once, as a step.

    Args:
        monotonic: CLOCK_MONOTONIC [ns].
        wall: CLOCK_REALTIME [ns].
    """

    def __init__(
        self, monotonic: Callable[[], int] = time.monotonic_ns, wall: Callable[[], int] = time.time_ns
    ) -> None:
        self.monotonic = monotonic
        self._wall = wall
        self._offset_ns = self._read_offset()
        self.steps = 0

    def wall(self, t_host_ns: int) -> int:
        """Wall-clock time [ns since the epoch] of a moment on the monotonic clock [ns]."""
        return t_host_ns + self._offset_ns

    def measure(self) -> int:
        """Measures the offset again and returns its change [ns]; counts a change beyond `STEP_NS`."""
        offset_ns = self._read_offset()
        change_ns, self._offset_ns = offset_ns - self._offset_ns, offset_ns
        self.steps += abs(change_ns) > STEP_NS
        return change_ns

    def _read_offset(self) -> int:
        # Of a few readings, the one with the shortest duration: the least disturbed by the scheduler.
        best_ns, offset_ns = None, 0
        for _ in range(5):
            before, wall, after = self.monotonic(), self._wall(), self.monotonic()
            if best_ns is None or after - before < best_ns:
                best_ns, offset_ns = after - before, wall - (before + after) // 2
        return offset_ns


class HeaderFactory:
    """Makes the headers of all messages of one process.

    Args:
        rig: name of the rig.
        clock: gives the stamps.
        boot_id: identifies the process instance; new with each `HeaderFactory` unless given.
        host: which clock `clock` reads, see `drivers.contract.host_clock`; that of this host unless given.
    """

    def __init__(self, rig: str, clock: WallClock, boot_id: str | None = None, host: str | None = None) -> None:
        self.rig = rig
        self.clock = clock
        self.boot_id = boot_id or uuid.uuid4().hex
        self.host_clock = host_clock() if host is None else host

    def at(self, t_host_ns: int, seq: int, frame_id: str = "") -> common_pb2.Header:
        """The header of a message about the moment `t_host_ns` (CLOCK_MONOTONIC) [ns]."""
        header = common_pb2.Header(
            t_host_ns=t_host_ns,
            seq=seq,
            rig=self.rig,
            frame_id=frame_id,
            boot_id=self.boot_id,
            host_clock=self.host_clock,
        )
        header.stamp.FromNanoseconds(self.clock.wall(t_host_ns))
        return header

    def elsewhere(
        self, t_host_ns: int, host_clock: str, t_here_ns: int, seq: int, frame_id: str = ""
    ) -> common_pb2.Header:
        """The header of a message about a moment on another host's clock, which was `t_here_ns` on this one's."""
        header = self.at(t_here_ns, seq, frame_id)
        header.t_host_ns, header.host_clock = t_host_ns, host_clock
        return header

    def now(self, seq: int, frame_id: str = "") -> common_pb2.Header:
        """The header of a message about the present moment."""
        return self.at(self.clock.monotonic(), seq, frame_id)
