"""The one place where kernel compilation is configured."""

import functools
import os
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., object])

#: Sums may be reordered so that loops vectorise; not-a-number still behaves as one, because missing returns are NaN.
_FASTMATH = {"reassoc", "contract", "arcp", "nsz"}

#: The range of a loop whose turns do not need each other: those over a population. Kernels divide it among as many
#: threads as the environment says. The code for one and for several threads is compiled apart, so that sums may differ
#: between them in the last digits of single precision. With one, equal input gives equal bits; with several it does in
#: processes that read the compiled code from the cache, but not always in the one that compiled it.
prange = range

#: Says how many threads a kernel has; the compiler's own name for it. One if it is not set.
THREADS = "NUMBA_NUM_THREADS"


def kernel(function: Function) -> Function:
    """Compiles `function` at its first call, caches the machine code on disk and runs it without interpreter lock.

    Kernels take contiguous arrays and scalars only; divisions follow IEEE rules instead of raising. The compiler takes
    a second to import, so whoever only reads a module's settings does not pay for it.
    """
    return cast(Function, _Kernel(function))


class _Kernel:
    """A function that becomes machine code at its first call."""

    def __init__(self, function: Callable[..., Any]):
        functools.update_wrapper(self, function)
        self._function = function

    def __call__(self, *arguments: Any) -> Any:
        return self.compiled(*arguments)

    @functools.cached_property
    def compiled(self) -> Callable[..., Any]:
        """The compiler's dispatcher; the kernels that the function calls must be dispatchers as well."""
        from numba import njit  # noqa: PLC0415

        names = self._function.__globals__
        for name, value in list(names.items()):
            if isinstance(value, _Kernel) and value is not self and name in self._function.__code__.co_names:
                names[name] = value.compiled
        options = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": _FASTMATH}
        if "prange" in self._function.__code__.co_names and int(os.environ.get(THREADS, "1")) > 1:
            return njit(parallel=True, **options)(_divided(self._function))
        return njit(**options)(self._function)


def _divided(function: Callable[..., Any]) -> Callable[..., Any]:
    """A copy whose loops over `prange` are divided; its other name keeps it apart in the compiler's cache."""
    from numba import config, prange  # noqa: PLC0415

    # OpenMP's threads wait ready for a moment, and several threads may call what they do.
    config.THREADING_LAYER = "omp"  # pyright: ignore[reportAttributeAccessIssue]
    copy = FunctionType(function.__code__, function.__globals__ | {"prange": prange}, function.__name__)
    copy.__module__, copy.__qualname__ = function.__module__, f"{function.__qualname__}_divided"
    return copy
