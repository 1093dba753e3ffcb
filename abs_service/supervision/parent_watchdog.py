"""Ends a child process when its supervisor has died, so that no orphans remain.

The supervisor holds the writing end of the child's standard input. When the supervisor dies, even by `kill -9`, the
kernel closes that end and the child reads the end of the file. What is written there are lines, which tell a child that
its configuration has changed.
"""

import os
import signal
import threading
import time

#: Set in the environment of children whose standard input is such a pipe.
VARIABLE = "ABS_SERVICE_PARENT_WATCHDOG"

#: Descriptor of the standard input: the pipe, also where Python's own object for it is another one.
STDIN = 0

_woken = threading.Event()

#: Time from SIGTERM to SIGKILL for an orphan [s].
GRACE_S = 3.0


def start() -> None:
    """If a supervisor started this process, ends it when the supervisor is gone: in order first, then by force."""
    if os.environ.pop(VARIABLE, ""):
        threading.Thread(target=_watch, args=(STDIN, GRACE_S), name="parent watchdog", daemon=True).start()


def was_woken() -> bool:
    """True if the supervisor has written a line since the last call, because the configuration has changed."""
    woken = _woken.is_set()
    _woken.clear()
    return woken


def _watch(descriptor: int, grace_s: float) -> None:
    while os.read(descriptor, 64):
        _woken.set()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(grace_s)
    os.kill(os.getpid(), signal.SIGKILL)
