"""Redirects the output of native libraries, which bypasses `sys.stdout`, into the log."""

import logging
import os
import re
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drivers.contract.text import printable

_log = logging.getLogger(__name__)

#: Time in which a line is logged once, however often it comes [s].
REPEATED_S = 10.0

_COLORS = re.compile(r"\x1b\[[\d;]*m")
#: Zenoh: time, level, thread, module. Its advice about a client that it refuses is wrong.
_ZENOH = re.compile(r"\S+Z +[A-Z]+ .*?ThreadId\(\d+\) (?P<module>[\w:]+): (?P<text>.*?)(?: Hint: increase the .*)?")


@contextmanager
def logged() -> Iterator[None]:
    """Context in which the lines are warnings of the log, and `sys.stdout` writes to where standard output was."""
    sys.stdout.flush()
    before, number = sys.stdout, os.dup(1)
    reads, writes = os.pipe()
    os.dup2(writes, 1)
    os.close(writes)
    reader = threading.Thread(target=_read, args=(reads,), name="library output", daemon=True)
    reader.start()
    try:
        with os.fdopen(os.dup(number), "w", encoding=before.encoding, buffering=1) as sys.stdout:
            yield
    finally:
        sys.stdout = before
        os.dup2(number, 1)  # closes the pipe
        os.close(number)
        reader.join()


def _read(reads: int) -> None:
    repetitions = Repetitions(time.monotonic)
    with os.fdopen(reads, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            if text := repetitions.line(plain(line)):
                _log.warning("%s", text)


def plain(line: str) -> str:
    """A line without colours; one of zenoh without its time, and with the meaning that it has for a user."""
    text = printable(_COLORS.sub("", line).strip())
    if (match := _ZENOH.fullmatch(text)) is None:
        return text
    refused = "a client was refused: " if match["module"] == "zenoh_link_tls::unicast" else ""
    return refused + match["text"]


class Repetitions:
    """Passes on a line, and with it how often it came since it was passed on last.

    Args:
        clock: time [s].
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._next_s: dict[str, float] = {}
        self._held_back: Counter[str] = Counter()

    def line(self, text: str) -> str:
        """The line that is to be logged; "" if it is too early."""
        now_s = self._clock()
        if now_s < self._next_s.get(text, now_s):
            self._held_back[text] += 1
            return ""
        self._next_s = {one: end_s for one, end_s in self._next_s.items() if one in self._held_back or now_s < end_s}
        self._next_s[text] = now_s + REPEATED_S
        number = self._held_back.pop(text, 0)
        return f"{text} ({number} times more since)" if number else text
