"""Waits for what other threads do, and threads that do something again and again."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

TIMEOUT_S = 20.0


def eventually(condition: Callable[[], object], timeout_s: float = TIMEOUT_S) -> bool:
    """True as soon as the condition holds, False if it does not in time."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return False


@contextmanager
def repeating(act: Callable[[], object], period_s: float) -> Iterator[None]:
    """Publishes, for example, again and again in another thread: nobody knows when a subscriber is there."""
    enough = threading.Event()

    def repeat() -> None:
        while not enough.wait(period_s):
            act()

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        yield
    finally:
        enough.set()
        thread.join()
