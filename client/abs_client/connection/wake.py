"""A signal from receiving threads to a waiting thread, or task of asyncio."""

import asyncio
import threading
from contextlib import suppress


class Wake:
    """Wakes the one that waits, or the next one that will; several signals in between count as one."""

    def __init__(self) -> None:
        self._signalled = threading.Event()
        self._lock = threading.Lock()
        self._task: tuple[asyncio.AbstractEventLoop, asyncio.Event] | None = None

    def signal(self) -> None:
        """Wakes it; from any thread."""
        with self._lock:
            self._signalled.set()
            if self._task is not None:
                loop, woken = self._task
                with suppress(RuntimeError):  # the loop was closed while its task waited
                    loop.call_soon_threadsafe(woken.set)

    def wait(self, timeout_s: float) -> None:
        """Returns after a signal, or after `timeout_s`."""
        self._signalled.wait(timeout_s)
        self._signalled.clear()

    async def wait_async(self, timeout_s: float) -> None:
        """The same for a task."""
        woken = asyncio.Event()
        with self._lock:
            if self._signalled.is_set():
                woken.set()
            self._task = asyncio.get_running_loop(), woken
        try:
            # `asyncio.wait_for` of Python 3.11 forgets a cancellation that comes together with the signal.
            async with asyncio.timeout(timeout_s):
                await woken.wait()
        except TimeoutError:
            pass
        finally:
            with self._lock:
                self._task = None
                self._signalled.clear()
