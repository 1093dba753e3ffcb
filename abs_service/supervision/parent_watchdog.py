"""Ends a child process when its supervisor has died, so that no orphans remain.

The supervisor holds the writing end of the child's standard input. When the supervisor dies, even by `kill -9`, the
kernel closes that end and the child reads the end of the file. What is written there are lines, which wake a child that
was started before it is needed (`standby`), or tell one that works that its configuration has changed.
"""

import os
import signal
import sys
import threading
import time
from importlib import import_module

#: Set in the environment of children whose standard input is such a pipe.
VARIABLE = "ABS_SERVICE_PARENT_WATCHDOG"

#: Set beside it for a child that waits until it is needed.
STANDBY = "ABS_SERVICE_STANDBY"

#: Niceness while such a child is loaded.
LOADING_NICE = 19

_needed = threading.Event()

#: Time from SIGTERM to SIGKILL for an orphan [s].
GRACE_S = 3.0


def start() -> None:
    """If a supervisor started this process, ends it when the supervisor is gone: in order first, then by force."""
    if os.environ.pop(VARIABLE, ""):
        threading.Thread(target=_watch, args=(sys.stdin.fileno(), GRACE_S), name="parent watchdog", daemon=True).start()


def load_gently(module: str) -> None:
    """In a child that waits, imports a module from a thread that steps back for all others; else does nothing."""
    if os.environ.get(STANDBY):
        # Linux has a niceness for each thread; that of the main thread could not be lowered again.
        thread = threading.Thread(target=_load, args=(module,), name="load")
        thread.start()
        thread.join()


def _load(module: str) -> None:
    os.nice(LOADING_NICE)
    import_module(module)


def wait_until_needed() -> bool:
    """True when the supervisor needs this process that was started to wait; False, at once, if it was not."""
    if not os.environ.pop(STANDBY, ""):
        return False
    _needed.wait()
    _needed.clear()
    return True


def was_woken() -> bool:
    """True if the supervisor has written a line since the last call, because the configuration has changed."""
    woken = _needed.is_set()
    _needed.clear()
    return woken


def _watch(descriptor: int, grace_s: float) -> None:
    while os.read(descriptor, 64):
        _needed.set()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(grace_s)
    os.kill(os.getpid(), signal.SIGKILL)
