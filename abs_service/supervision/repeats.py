"""Limits repeated messages: a lasting failure must not fill a log."""

import re
import threading
from dataclasses import dataclass

#: Number of times that the same text is reported as it comes.
AT_ONCE = 5
#: Time after which it is reported again then, at first and at most: it doubles each time [ns].
FIRST_NS, MAX_INTERVAL_NS = 60_000_000_000, 600_000_000_000
#: Texts that are remembered.
MAX_TEXTS = 1000

#: They differ from one time to the next: numbers of processes, times.
_NUMBERS = re.compile(r"\d+")

#: First line of a traceback; the last one is the next that is not indented.
_TRACEBACK = "Traceback (most recent call last):"


@dataclass
class _Report:
    t_ns: int
    times: int = 1
    pause_ns: int = 0
    left_out: int = 0


class Repeats:
    """Reports of each message so far. May be called from any thread."""

    def __init__(self) -> None:
        self._reports: dict[str, _Report] = {}
        self._lock = threading.Lock()

    def take(self, text: str, now_ns: int) -> int | None:
        """Number of times that a text was left out since its last report; None if it is left out now, too.

        Args:
            text: the message; numbers in it make no difference.
            now_ns: monotonic time [ns].
        """
        key = _NUMBERS.sub("0", text)
        with self._lock:
            last = self._reports.get(key)
            # What has not come for long is new.
            if last is None or now_ns - last.t_ns > 2 * max(last.pause_ns, FIRST_NS):
                if len(self._reports) >= MAX_TEXTS:
                    self._reports.clear()
                self._reports[key] = _Report(now_ns)
                return last.left_out if last else 0
            if now_ns - last.t_ns < last.pause_ns:
                last.left_out += 1
                return None
            longer_ns = min(max(2 * last.pause_ns, FIRST_NS), MAX_INTERVAL_NS)
            self._reports[key] = _Report(now_ns, last.times + 1, longer_ns if last.times + 1 >= AT_ONCE else 0)
            return last.left_out


def counted(text: str, left_out: int) -> str:
    """A text, with the number of times that it was left out."""
    return f"{text} ({left_out} more of these since the last one that was reported)" if left_out else text


class Tracebacks:
    """Lines that processes write, without tracebacks that come again and again: each is held until it is complete."""

    def __init__(self) -> None:
        self._repeats = Repeats()
        self._held: dict[str, list[str]] = {}

    def take(self, component: str, line: str, now_ns: int) -> list[str]:
        """The lines to report after a process has written another one. Each process has a thread of its own.

        Args:
            component: name of the process.
            line: what it wrote.
            now_ns: monotonic time [ns].
        """
        begins = line == _TRACEBACK
        if not begins and component not in self._held:
            return [line]
        held = self._held.setdefault(component, [])
        held.append(line)
        if begins or line.startswith(" "):
            return []
        del self._held[component]
        left_out = self._repeats.take("\n".join([component, *held]), now_ns)
        return [] if left_out is None else [*held[:-1], counted(line, left_out)]
