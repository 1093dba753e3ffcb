"""Declaring what a library calls back from threads of its own."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


def from_non_daemon_thread(declare: Callable[[], T]) -> T:
    """Declares something with a callback to zenoh, from a thread that is no daemon; raises what `declare` raises.

    The thread in which zenoh calls back is a daemon if the declaring thread is one. The interpreter does not wait for
    daemons when it ends: such a thread, awakened by the session's close, would return from Rust to an interpreter that
    is gone, and abort the process ("FATAL: exception not rethrown").
    """
    declared: Future[T] = Future()

    def run() -> None:
        try:
            declared.set_result(declare())
        except Exception as error:
            declared.set_exception(error)

    threading.Thread(target=run, name="declare", daemon=False).start()
    return declared.result()
