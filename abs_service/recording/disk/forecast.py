"""Forecast of the time until the disk is full."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

#: Time over which the rate is averaged [ns].
WINDOW_NS = 60_000_000_000
#: Said of a disk that is full before the limits of the recordings delete any.
TOO_SMALL = ", too small for what record.retain_* and record.rotate_* keep"
#: Said of a disk on which recording does not begin.
NO_ROOM = "less than record.minimum_free_bytes is free on this disk"


class RateMeter:
    """Average rate of a total over the last minute, or since it began to grow from 0."""

    def __init__(self) -> None:
        self._points: deque[tuple[int, float]] = deque()

    def add(self, t_ns: int, total: float) -> float:
        """Adds a value at a time [ns]; returns the rate [1/s], 0 at first."""
        if not total:  # nothing is written yet, as while kernels are compiled: not part of the average
            self._points.clear()
        self._points.append((t_ns, total))
        while self._points[0][0] < t_ns - WINDOW_NS:
            self._points.popleft()
        then_ns, before = self._points[0]
        return (total - before) * 1e9 / (t_ns - then_ns) if t_ns > then_ns else 0.0


@dataclass(frozen=True, slots=True)
class Growth:
    """Files of one kind, which are written and, when they are too old or too large, deleted.

    Attributes:
        rate: of recording [bytes/s].
        used: size of those that may be deleted, together [bytes].
        retain_s, retain_bytes: see `Retention`.
        file_bytes: size of one file, which is not deleted before it is finished, and not aged before that [bytes].
    """

    rate: float
    used: float
    retain_s: float
    retain_bytes: float
    file_bytes: float = 0.0

    @property
    def more(self) -> float:
        """Growth until as much is deleted as is written [bytes]; negative if the files shrink."""
        by_age = self.retain_s * self.rate + self.file_bytes
        return min(max(self.retain_bytes, self.file_bytes), by_age) - self.used

    @property
    def kept_s(self) -> float:
        """Time of which there are files then [s]."""
        return min(self.retain_s, self.retain_bytes / self.rate)


def room_s(kinds: Sequence[Growth], room: float) -> float:
    """Time until the disk is full [s]; infinite if files are deleted before it is.

    Args:
        kinds: of files on the disk.
        room: bytes that may still be written.
    """
    growing = sorted((kind for kind in kinds if kind.rate > 0), key=lambda kind: kind.more / kind.rate)
    left, now_s = room + sum(max(-kind.more, 0.0) for kind in growing), 0.0
    for number, kind in enumerate(growing):
        rate = sum(other.rate for other in growing[number:])
        until_s = max(kind.more, 0.0) / kind.rate
        if rate * (until_s - now_s) > left:
            return now_s + max(left, 0.0) / rate
        left -= rate * (until_s - now_s)
        now_s = until_s
    return float("inf")


def text(recordings: Growth, estimates: Growth, room: float) -> str:
    """The same for people: "2.6 days on this disk", "the last 2.6 days are kept", "" if nothing is recorded."""
    if recordings.rate <= 0:
        return ""
    seconds = room_s((recordings, estimates), room)
    if seconds <= 0:
        return NO_ROOM
    if seconds < float("inf"):
        unmet = seconds * recordings.rate < recordings.more < float("inf")
        return f"{duration(seconds)} on this disk" + TOO_SMALL * unmet
    kept = f"the last {duration(recordings.kept_s)} are kept"
    return f"{kept}, estimates of {duration(estimates.kept_s)}" if estimates.rate > 0 else kept


def duration(seconds: float) -> str:
    """A time for people, in the largest unit of which there are two."""
    for unit, length in (("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s"
