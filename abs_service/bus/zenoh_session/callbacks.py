"""Declaration of zenoh callbacks from a non-daemon thread."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


def from_non_daemon_thread(declare: Callable[[], T]) -> T:
    """Calls `declare`, which registers a callback with zenoh, from a non-daemon thread; raises what `declare` raises.

    zenoh's callback thread inherits the daemon flag of the declaring thread, and the interpreter does not join daemon
    threads at exit. When the session closes, such a thread would return from Rust into a finalized interpreter and
    abort the process ("FATAL: exception not rethrown").
    """
    declared: Future[T] = Future()

    def run() -> None:
        try:
            declared.set_result(declare())
        except Exception as error:
            declared.set_exception(error)

    threading.Thread(target=run, name="declare", daemon=False).start()
    return declared.result()
