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

#: Time from SIGTERM to SIGKILL for an orphan [s].
GRACE_S = 3.0


def start() -> threading.Event:
    """Ends this process when the supervisor that started it is gone: in order first, then by force.

    Returns:
        An event that is set whenever the supervisor says that the configuration has changed; it is for the caller to
        clear, before the configuration is read.
    """
    woken = threading.Event()
    if os.environ.pop(VARIABLE, ""):
        watch = threading.Thread(target=_watch, args=(STDIN, GRACE_S, woken), name="parent watchdog", daemon=True)
        watch.start()
    return woken


def _watch(descriptor: int, grace_s: float, woken: threading.Event) -> None:
    while os.read(descriptor, 64):
        woken.set()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(grace_s)
    os.kill(os.getpid(), signal.SIGKILL)
