"""Pools in shared memory, and the memory of those whose process has ended.

zenoh keeps every pool that it has mapped for the life of a process, with its file (eclipse-zenoh/zenoh #2787). Without
help, each restart of a process that publishes images would cost a rig that goes on 32 MB. See decision 0034.
"""

import mmap
import os
import threading
from collections.abc import Callable, Iterator, Set
from contextlib import contextmanager, suppress
from pathlib import Path

#: A pool's size is a multiple of this plus its owner's process number, which is less on Linux.
UNIT_BYTES = 1 << 22
#: Time after the end of a process in which its last images are still read [ns].
READ_NS = 10_000_000_000

#: Time between two checks whether the pool of this process is still there [s].
CHECK_S = 1.0

FILES = Path("/proc/self/fd")


class DeletedError(ConnectionError):
    """Another program has deleted the pool of this process; a new process has a new one."""


def own_size(size: int) -> int:
    """Size of this process's pool [bytes], about as asked for; 0 if that is less than `UNIT_BYTES`."""
    return size - size % UNIT_BYTES + os.getpid() if size >= UNIT_BYTES else 0


def free_pool(process: int) -> None:
    """Gives back the memory of the pool of an ended process, as far as this process has mapped it; its file stays.

    Whoever still read in it would read zeros.
    """
    for file, about in _pools(process):
        with suppress(OSError):  # closed in the meantime
            _punch(file, about.st_size)


@contextmanager
def watched(end: Callable[[], None]) -> Iterator[None]:
    """Calls `end`, from a thread, when another program has deleted the pool of this process.

    Who has mapped it reads on. Who comes later cannot, and would miss all large messages without a word.

    Raises:
        DeletedError: when its body has ended, if that has happened.
    """
    is_over, deleted = threading.Event(), threading.Event()

    def watch() -> None:
        while not (deleted.is_set() or is_over.wait(CHECK_S)):
            if any(about.st_nlink == 0 for _, about in _pools(os.getpid())):
                deleted.set()
                end()

    threading.Thread(target=watch, name="shared memory", daemon=True).start()
    try:
        yield
    finally:
        is_over.set()
    if deleted.is_set():
        by = "systemd does so when its user logs out: `loginctl enable-linger` or RemoveIPC=no in logind.conf"
        raise DeletedError(f"another program has deleted the shared memory of this process in /dev/shm; {by}")


def _pools(process: int) -> Iterator[tuple[Path, os.stat_result]]:
    """Open files of this process that are the pool of a process, and what the system knows of them."""
    for file in FILES.iterdir():
        with suppress(OSError):  # closed in the meantime
            about = file.stat()
            is_pool = about.st_size > UNIT_BYTES and str(file.readlink()).startswith("/dev/shm/")
            if is_pool and about.st_size % UNIT_BYTES == process:
                yield file, about


def _punch(file: Path, size: int) -> None:
    descriptor = os.open(file, os.O_RDWR)
    try:
        with mmap.mmap(descriptor, size) as pool:
            pool.madvise(mmap.MADV_REMOVE)
    finally:
        os.close(descriptor)


class EndedPools:
    """Frees the pools of processes some time after they ended."""

    def __init__(self, clock: Callable[[], int], free: Callable[[int], None] = free_pool) -> None:
        self._clock, self._free = clock, free
        self._running: frozenset[int] = frozenset()
        self._due_ns: dict[int, int] = {}

    def update(self, running: Set[int]) -> None:
        """Takes the numbers of the processes that run now."""
        now_ns = self._clock()
        self._due_ns.update(dict.fromkeys(self._running - running, now_ns + READ_NS))
        self._running = frozenset(running)
        for process in [process for process, due_ns in self._due_ns.items() if due_ns <= now_ns]:
            del self._due_ns[process]
            if process not in running:  # the system gives numbers again
                self._free(process)
