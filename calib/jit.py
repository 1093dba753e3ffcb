"""The one place where kernel compilation is configured."""

import functools
import hashlib
import os
from collections.abc import Callable, Mapping
from inspect import ismodule
from types import FunctionType
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., object])

#: Sums may be reordered so that loops vectorise; not-a-number still behaves as one, because missing returns are NaN.
_FASTMATH = {"reassoc", "contract", "arcp", "nsz"}

#: The range of a loop whose turns do not need each other: those over a population. Kernels divide it among as many
#: threads as the environment says; those that another kernel calls do not, since that one has divided the work. The
#: code for one and for several threads is compiled apart, so that sums may differ between them in the last digits of
#: single precision. With one, equal input gives equal bits; with several it does in processes that read the compiled
#: code from the cache, but not always in the one that compiled it.
prange = range

#: Says how many threads a kernel has; the compiler's own name for it. One if it is not set.
THREADS = "NUMBA_NUM_THREADS"


def kernel(function: Function) -> Function:
    """Compiles `function` at its first call, caches the machine code on disk and runs it without interpreter lock.

    Kernels take contiguous arrays and scalars only; divisions follow IEEE rules instead of raising. The compiler takes
    a second to import, so whoever only reads a module's settings does not pay for it.
    """
    return cast(Function, _Kernel(function, {}))


@functools.cache
def composed(template: Function, **parts: Callable[..., Any] | int) -> Function:
    """A kernel like `template`, with other kernels and constants in place of the globals that have these names.

    They are compiled into it, as if they had been written there: nothing is looked up or decided while it runs.

    Args:
        template: a kernel.
        parts: other kernels, or constants, by the names of the template's globals.
    """
    return cast(Function, _Kernel(cast(_Kernel, template).function, parts))


class _Kernel:
    """A function that becomes machine code at its first call."""

    def __init__(self, function: Callable[..., Any], parts: Mapping[str, Any]):
        functools.update_wrapper(self, function)
        self.function = function
        self._parts = parts

    def __call__(self, *arguments: Any) -> Any:
        return self._compiled(*arguments)

    @functools.cached_property
    def _compiled(self) -> Callable[..., Any]:
        """The compiler's dispatcher."""
        if "prange" not in self.function.__code__.co_names or int(os.environ.get(THREADS, "1")) == 1:
            return self.undivided
        from numba import config, prange  # noqa: PLC0415

        # OpenMP's threads wait ready for a moment, and several threads may call what they do.
        config.THREADING_LAYER = "omp"  # pyright: ignore[reportAttributeAccessIssue]
        return self._compile("_divided", {"prange": prange}, parallel=True)

    @functools.cached_property
    def undivided(self) -> Callable[..., Any]:
        """The same for one thread, which other kernels may call."""
        return self._compile("", {})

    def _compile(self, suffix: str, replaced: dict[str, Any], *, parallel: bool = False) -> Callable[..., Any]:
        from numba import njit  # noqa: PLC0415

        called = {name: value.undivided for name, value in self._globals.items() if isinstance(value, _Kernel)}
        scope = self.function.__globals__ | self._globals | called | replaced
        copy = FunctionType(self.function.__code__, scope, self.function.__name__)
        copy.__module__ = self.function.__module__
        copy.__qualname__ = f"{self.function.__qualname__}_{self.digest}{suffix}"
        return njit(cache=True, nogil=True, error_model="numpy", fastmath=_FASTMATH, parallel=parallel)(copy)

    @functools.cached_property
    def digest(self) -> str:
        """Of all that the machine code is made from, and its name in the compiler's cache.

        By itself, the compiler would look only at the file that the function is in.
        """
        used = ((name, value.digest if isinstance(value, _Kernel) else value) for name, value in self._globals.items())
        values = sorted((name, repr(value)) for name, value in used if not (callable(value) or ismodule(value)))
        return hashlib.sha256(repr((_readable(self.function), values)).encode()).hexdigest()[:12]

    @functools.cached_property
    def _globals(self) -> dict[str, Any]:
        """What the function uses of its module, or in place of that."""
        used = set(self.function.__code__.co_names)
        known = self.function.__globals__ | dict(self._parts)
        return {name: value for name, value in known.items() if name in used}


def _readable(function: Callable[..., Any]) -> tuple[object, ...]:
    """What a function does, without where it is written and what is said about it."""
    code = function.__code__
    constants = [repr(constant) for constant in code.co_consts if constant != function.__doc__]
    return code.co_code, code.co_names, code.co_varnames, constants
