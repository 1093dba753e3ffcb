"""Kernels that wait for compilation, the largest first."""

import threading
import time
from collections.abc import Callable
from math import inf
from typing import Any

from calib.jit import Kernel

#: The time for the rest is estimated once this share of all code is compiled: before, it is mostly the start of the
#: workers.
_TELLING_SHARE = 0.05

#: A kernel, and the types of its arguments.
Task = tuple[Kernel, tuple[Any, ...]]


class KernelQueue:
    """Hands kernels to several workers.

    The largest kernel that is known is next, so that the end is not spent waiting for one that began late. No two
    workers have the same kernel at once, for other types: Numba's index of a kernel's code is not made for that.

    Attributes:
        total: kernels that were put.
        done: those that are finished, successfully or not.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self.total = 0
        self.done = 0
        self._clock = clock
        self._waiting: list[Task] = []
        self._busy: set[str] = set()
        self._changed = threading.Condition()
        self._closed = False
        self._began_s = 0.0
        self._size = self._done_size = 0

    @property
    def left_s(self) -> float:
        """Estimated time for the remaining kernels, by the size of their code [s]; infinite as long as few are done."""
        with self._changed:
            share = self._done_size / self._size if self._done_size else 0.0
        return (self._clock() - self._began_s) * (1 / share - 1) if share >= _TELLING_SHARE else inf

    def put(self, task: Task) -> None:
        """Adds a kernel."""
        with self._changed:
            if not self.total:
                self._began_s = self._clock()
            self.total += 1
            self._size += task[0].size
            self._waiting.append(task)
            self._changed.notify_all()

    def take(self) -> Task | None:
        """The next kernel that no other worker has, as soon as there is one; None once the queue is closed."""
        with self._changed:
            while not self._closed:
                free = [task for task in self._waiting if task[0].digest not in self._busy]
                if free:
                    task = max(free, key=lambda task: task[0].size)
                    self._waiting.remove(task)
                    self._busy.add(task[0].digest)
                    return task
                self._changed.wait()
        return None

    def finish(self, kernel: Kernel) -> None:
        """Marks a taken kernel as done."""
        with self._changed:
            self.done += 1
            self._done_size += kernel.size
            self._busy.discard(kernel.digest)
            self._changed.notify_all()

    def wait(self, over: Callable[[], bool], timeout_s: float) -> bool:
        """True if `over` is true within that time; asked after every change."""
        with self._changed:
            return self._changed.wait_for(over, timeout_s)

    def close(self) -> None:
        """Sends the workers home."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
