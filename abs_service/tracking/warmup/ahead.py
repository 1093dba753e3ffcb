"""Kernels are compiled by other processes while this one runs their plain Python form.

Which kernels a program needs, and for which types, shows only when it runs, and it cannot run on without their results.
Python computes these slowly, but at once, so that all kernels are known, and being compiled, within seconds.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from math import ceil, isfinite
from typing import Any

import numpy as np

from abs_service.tracking.warmup.pool import Pool
from calib.jit import Kernel

#: Processes beyond this number gain little: the longest kernel alone takes a tenth of the whole.
MAX_WORKERS = 8
#: Interval of the reports while the last kernels are waited for [s].
PERIOD_S = 0.2


@dataclass(frozen=True, slots=True)
class Progress:
    """Number of kernels that are compiled, of those known to be needed, and about how long the others take [s]."""

    done: int
    total: int
    left_s: float

    def __str__(self) -> str:
        if not isfinite(self.left_s):
            return f"{self.done} of {self.total}"
        return f"{self.done} of {self.total}, about {ceil(self.left_s)} s"


def ignore(progress: Progress) -> None:
    """Null object: progress is not reported."""


@contextmanager
def compiled_ahead(report: Callable[[Progress], None] = ignore) -> Iterator[Pool]:
    """Context in which Python runs kernels that the cache lacks while others compile them; its end waits for all.

    Kernels that have been called before are as they were. What could not be compiled elsewhere, such as a kernel that
    is not in a module, is compiled at its next call.

    Args:
        report: called with the progress, in the waiting thread.

    Yields:
        The compilation; its `total` is the number of missing kernels.
    """
    workers = min(MAX_WORKERS, len(os.sched_getaffinity(0)))
    with Pool(workers) as pool:
        with _stood_in_for(lambda kernel: StandIn(kernel, pool)):
            yield pool
        while not pool.wait(PERIOD_S):
            report(Progress(pool.done, pool.total, pool.left_s))


class NotCachedError(Exception):
    """A kernel would have to be compiled."""


def cached_only() -> AbstractContextManager[None]:
    """Context in which a kernel that is not in the cache raises NotCachedError instead of being compiled."""
    return _stood_in_for(lambda kernel: partial(_call_cached, kernel))


@contextmanager
def _stood_in_for(by: Callable[[Kernel], Callable[..., Any]]) -> Iterator[None]:
    """Context in which a stand-in takes the calls of kernels that have not been called before."""
    taken: list[Kernel] = []

    def stand_in(kernel: Kernel) -> Callable[..., Any]:
        taken.append(kernel)
        return by(kernel)

    Kernel.stand_in = stand_in
    try:
        yield
    finally:
        Kernel.stand_in = None
        for kernel in taken:
            kernel.forget()


def _call_cached(kernel: Kernel, *arguments: Any) -> Any:
    if not kernel.load(kernel.types(arguments)):
        raise NotCachedError(kernel.digest)
    return kernel.dispatcher(*arguments)


class StandIn:
    """Takes the calls of a kernel: the compiled one if it is in the cache, else the plain one."""

    def __init__(self, kernel: Kernel, pool: Pool):
        self._kernel = kernel
        self._pool = pool
        self._known: dict[tuple[Any, ...], Callable[..., Any]] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Runs the kernel in one of its forms."""
        types = self._kernel.types(arguments)
        if types not in self._known:
            self._known[types] = self._choose(types)
        return self._known[types](*arguments)

    def _choose(self, types: tuple[Any, ...]) -> Callable[..., Any]:
        if self._kernel.load(types):
            return self._kernel.dispatcher
        self._pool.submit(self._kernel, types)
        return self._plain

    def _plain(self, *arguments: Any) -> Any:
        try:
            with np.errstate(all="ignore"):
                result = self._kernel.plain(*arguments)
        except Exception:  # Python checks more than a kernel does; one that cannot do without machine code waits for it
            return self._kernel.dispatcher(*arguments)
        return result.item() if isinstance(result, np.generic) else result  # as Numba returns it
