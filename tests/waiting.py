"""Waits for what other threads do."""

import time
from collections.abc import Callable

TIMEOUT_S = 20.0


def eventually(condition: Callable[[], object], timeout_s: float = TIMEOUT_S) -> bool:
    """True as soon as the condition holds, False if it does not in time."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return False
