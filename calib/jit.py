"""The one place where kernel compilation is configured."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def kernel(function: Kernel) -> Kernel:
    """Compiles `function` once, caches the machine code on disk and releases the interpreter lock while it runs.

    Kernels take contiguous arrays and scalars only. Divisions follow IEEE rules instead of raising, and sums may be
    reordered so that loops vectorise; not-a-number still behaves as one, because missing returns are NaN.
    """
    options = {"reassoc", "contract", "arcp", "nsz"}
    return cast(Kernel, numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=options)(function))
