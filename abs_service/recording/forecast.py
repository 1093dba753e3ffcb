"""How long the disk lasts."""

from collections import deque

#: Time over which the rate is averaged [ns].
WINDOW_NS = 60_000_000_000


class RateMeter:
    """Average rate of a total over the last minute."""

    def __init__(self) -> None:
        self._points: deque[tuple[int, float]] = deque()

    def add(self, t_ns: int, total: float) -> float:
        """Adds a value at a time [ns]; returns the rate [1/s], 0 at first."""
        self._points.append((t_ns, total))
        while self._points[0][0] < t_ns - WINDOW_NS:
            self._points.popleft()
        then_ns, before = self._points[0]
        return (total - before) * 1e9 / (t_ns - then_ns) if t_ns > then_ns else 0.0


def room_s(rate: float, room: float, used: float, retain_s: float, retain_bytes: float) -> float:
    """Time until the disk is full [s]; infinite if recordings are deleted before it is.

    Args:
        rate: of recording [bytes/s].
        room: bytes that may still be written.
        used: size of the recordings that may be deleted, together [bytes].
        retain_s, retain_bytes: see `Retention`.
    """
    kept = min(retain_bytes, retain_s * rate)
    return float("inf") if rate <= 0 or kept <= used + room else max(room, 0.0) / rate


def text(rate: float, room: float, used: float, retain_s: float, retain_bytes: float) -> str:
    """The same for people: "2.6 days on this disk", "the last 2.6 days are kept", "" if nothing is recorded."""
    if rate <= 0:
        return ""
    seconds = room_s(rate, room, used, retain_s, retain_bytes)
    if seconds == float("inf"):
        return f"the last {duration(min(retain_s, retain_bytes / rate))} are kept"
    return f"{duration(seconds)} on this disk"


def duration(seconds: float) -> str:
    """A time for people, in the largest unit of which there are two."""
    for unit, length in (("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s"
