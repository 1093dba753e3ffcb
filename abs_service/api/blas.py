"""One thread for BLAS while a frame is computed.

The matrices are small. Several threads of OpenBLAS that wait for each other spin: beside other programs, a frame takes
ten times as long. The commands limit BLAS in the environment of their processes; a program that has arrays is not ours,
and its own products may have all cores as soon as a frame is done.
"""

import functools
import threading

import scipy.linalg.cython_blas  # noqa: F401  whose BLAS Numba's products use; what is loaded later is not limited
from threadpoolctl import ThreadpoolController


class OneBlasThread:
    """Context in which the BLAS libraries of the process use one thread.

    The limit is that of the process. Where several threads are inside, the last one that leaves restores what the first
    one found.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0

    def __enter__(self) -> None:
        with self._lock:
            if not self._inside:
                self._limit = _libraries().limit(limits=1)
            self._inside += 1

    def __exit__(self, *error: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                self._limit.restore_original_limits()


@functools.cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController().select(user_api="blas")


#: The one of this process.
one_blas_thread = OneBlasThread()
