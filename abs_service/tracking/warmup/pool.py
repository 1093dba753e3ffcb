"""Processes that compile kernels."""

import logging
import os
import pickle
import subprocess
import sys
import threading
import time
from math import inf
from typing import IO, Any, Self, cast

from calib.jit import Kernel

_log = logging.getLogger(__name__)

#: Not from the folder where we are, which may hold another copy of these sources, but from where this process has them.
COMMAND = sys.executable, "-P", "-m", "abs_service.tracking.warmup.worker"


class Pool:
    """Compiles kernels in other processes; a context manager that ends them.

    A process begins when there is work for it. The largest kernel that is known is next, so that the end is not spent
    waiting for one that began late. No two compile the same kernel at once, for other types: Numba's index
    of a kernel's code is not made for that.

    Args:
        workers: number of processes at most.

    Attributes:
        total: kernels that were asked for.
        done: those that are finished, successfully or not.
    """

    def __init__(self, workers: int):
        self.total = 0
        self.done = 0
        self._workers = workers
        self._threads: list[threading.Thread] = []
        self._waiting: list[tuple[Kernel, tuple[Any, ...]]] = []
        self._busy: set[str] = set()
        self._changed = threading.Condition()
        self._closed = False
        self._began_s = 0.0
        self._size = self._done_size = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def left_s(self) -> float:
        """About how long the others take, by the size of their code [s]; infinite as long as none is done."""
        with self._changed:
            share = self._done_size / self._size if self._done_size else 0.0
        return (time.monotonic() - self._began_s) * (1 / share - 1) if share else inf

    def submit(self, kernel: Kernel, types: tuple[Any, ...]) -> None:
        """Asks for a kernel for arguments of these types."""
        with self._changed:
            if not self.total:
                self._began_s = time.monotonic()
            self.total += 1
            self._size += kernel.size
            self._waiting.append((kernel, types))
            if len(self._threads) < self._workers:
                self._threads.append(threading.Thread(target=self._work, name="compilation", daemon=True))
                self._threads[-1].start()
            self._changed.notify_all()

    def wait(self, timeout_s: float) -> bool:
        """True if within that time everything was done that can be done here."""

        def over() -> bool:
            return self.done == self.total or not any(thread.is_alive() for thread in self._threads)

        with self._changed:
            return self._changed.wait_for(over, timeout_s)

    def _work(self) -> None:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(COMMAND, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
            requests, answers = cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)
            while (task := self._take()) is not None:
                try:
                    pickle.dump(pickle.dumps(task), requests)
                    requests.flush()
                    answer = pickle.load(answers)
                except (OSError, EOFError) as error:
                    _log.warning("a process that compiles kernels has died: %r", error)
                    return
                finally:
                    self._finish(task[0])
                if answer:
                    _log.debug("%s: %s", task[0].digest, answer)

    def _take(self) -> tuple[Kernel, tuple[Any, ...]] | None:
        """A kernel that no other process works on; None at the end."""
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

    def _finish(self, kernel: Kernel) -> None:
        with self._changed:
            self.done += 1
            self._done_size += kernel.size
            self._busy.discard(kernel.digest)
            self._changed.notify_all()
