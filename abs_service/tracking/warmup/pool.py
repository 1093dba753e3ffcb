"""Processes that compile kernels."""

import logging
import os
import pickle
import subprocess
import sys
import threading
from typing import IO, Any, Self, cast

from abs_service.tracking.warmup.kernel_queue import KernelQueue
from calib.jit import Kernel

_log = logging.getLogger(__name__)

#: Not from the folder where we are, which may hold another copy of these sources, but from where this process has them.
COMMAND = sys.executable, "-P", "-m", "abs_service.tracking.warmup.worker"


class Pool:
    """Compiles kernels in other processes; a context manager that ends them.

    A process begins when there is work for it; see `KernelQueue` for the order.
    """

    def __init__(self, workers: int):
        self._queue = KernelQueue()
        self._workers = workers
        self._threads: list[threading.Thread] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._queue.close()

    @property
    def total(self) -> int:
        """Kernels that were asked for."""
        return self._queue.total

    @property
    def done(self) -> int:
        """Kernels that are finished, successfully or not."""
        return self._queue.done

    @property
    def left_s(self) -> float:
        """See `KernelQueue.left_s`."""
        return self._queue.left_s

    def submit(self, kernel: Kernel, types: tuple[Any, ...]) -> None:
        """Asks for a kernel for arguments of these types."""
        self._queue.put((kernel, types))
        if len(self._threads) < self._workers:
            self._threads.append(threading.Thread(target=self._work, name="compilation", daemon=True))
            self._threads[-1].start()

    def wait(self, timeout_s: float) -> bool:
        """True if within that time everything was done that can be done here."""

        def over() -> bool:
            return self.done == self.total or not any(thread.is_alive() for thread in self._threads)

        return self._queue.wait(over, timeout_s)

    def _work(self) -> None:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(COMMAND, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
            requests, answers = cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)
            while (task := self._queue.take()) is not None:
                try:
                    pickle.dump(pickle.dumps(task), requests)
                    requests.flush()
                    answer = pickle.load(answers)
                except (OSError, EOFError) as error:
                    _log.warning("a process that compiles kernels has died: %r", error)
                    return
                finally:
                    self._queue.finish(task[0])
                if answer:
                    _log.debug("%s: %s", task[0].digest, answer)
