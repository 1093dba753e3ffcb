"""The one place where kernel compilation is configured."""

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., object])

#: Sums may be reordered so that loops vectorise; not-a-number still behaves as one, because missing returns are NaN.
_FASTMATH = {"reassoc", "contract", "arcp", "nsz"}


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
        return njit(cache=True, nogil=True, error_model="numpy", fastmath=_FASTMATH)(self._function)
