"""Texts that come again and again: a failure that nobody mends must not fill a log."""

import re
import threading
from dataclasses import dataclass

#: Time after which the same text is told again, at first and at most: it doubles each time [ns].
FIRST_NS, LONGEST_NS = 60_000_000_000, 600_000_000_000
#: Texts that are remembered.
MOST = 1000

#: They differ from one time to the next: numbers of processes, times.
_NUMBERS = re.compile(r"\d+")

#: First line of a traceback; the last one is the next that is not indented.
_TRACEBACK = "Traceback (most recent call last):"


@dataclass
class _Told:
    t_ns: int
    pause_ns: int = FIRST_NS
    left_out: int = 0


class Repeats:
    """Remembers what was told. May be called from any thread."""

    def __init__(self) -> None:
        self._told: dict[str, _Told] = {}
        self._lock = threading.Lock()

    def take(self, text: str, now_ns: int) -> int | None:
        """Number of times that a text was left out since it was told last; None if it is left out now, too.

        Args:
            text: what is to be told; numbers in it make no difference.
            now_ns: monotonic time [ns].
        """
        key = _NUMBERS.sub("0", text)
        with self._lock:
            last = self._told.get(key)
            passed_ns = now_ns - last.t_ns if last else 0
            if last and passed_ns < last.pause_ns:
                last.left_out += 1
                return None
            if len(self._told) >= MOST:
                self._told.clear()
            # What has not come for long is new.
            again = last is not None and passed_ns <= 2 * last.pause_ns
            pause_ns = min(2 * last.pause_ns, LONGEST_NS) if last and again else FIRST_NS
            self._told[key] = _Told(now_ns, pause_ns)
            return last.left_out if last else 0


def counted(text: str, left_out: int) -> str:
    """A text, with the number of times that it was left out."""
    return f"{text} ({left_out} more of these since the last one that was told)" if left_out else text


class Tracebacks:
    """Lines that processes write, without tracebacks that come again and again: each is held until it is complete."""

    def __init__(self) -> None:
        self._repeats = Repeats()
        self._held: dict[str, list[str]] = {}

    def take(self, component: str, line: str, now_ns: int) -> list[str]:
        """The lines to tell, now that a process has written another one. Each process has a thread of its own.

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
