"""Compilation of kernels with Numba: configuration, composition and cache keys."""

import functools
import hashlib
import os
import pickle
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from inspect import ismodule
from types import FunctionType
from typing import Any, ClassVar, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., object])

#: Sums may be reordered for vectorisation; NaN semantics are kept, because NaN marks missing returns.
_FASTMATH = "reassoc", "contract", "arcp", "nsz"

#: Nothing calls a kernel from C.
_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

#: A kernel that another calls becomes part of its code. A called function would have a copy in every object file, each
#: optimised by itself, and the linker takes the one that is loaded first: a process that compiles would round
#: differently from those that load from the cache. By itself it is never loaded, so it needs no place in the cache.
_CALLED: dict[str, Any] = {"forceinline": True, "no_cpython_wrapper": True, "cache": False}

#: Parallel loop over a population. A kernel divides its iterations among as many threads as the environment sets;
#: kernels called by another kernel run serially. Serial and parallel code are compiled separately, so that sums may
#: differ in the last digits of single precision. Results with one thread are reproducible bit by bit; results with
#: several are in processes that load the code from the cache, but not always in the process that compiled it.
prange = range

#: Numba's environment variable for the number of threads of a kernel; one if it is not set.
THREADS = "NUMBA_NUM_THREADS"


def kernel(function: Function) -> Function:
    """Compiles `function` at its first call; caches the machine code on disk; releases the interpreter lock.

    Kernels take contiguous arrays, scalars and named tuples of them; divisions follow IEEE rules and do not raise.
    Numba is imported at the first call, because the import takes a second.
    """
    return cast(Function, Kernel(function, {}))


@functools.cache
def composed(template: Function, **parts: Callable[..., Any] | int) -> Function:
    """Copy of the kernel `template` in which the named globals are replaced by other kernels and constants.

    The parts are compiled into it like ordinary globals, without dispatch at run time.

    Args:
        template: a kernel.
        parts: kernels or constants, keyed by the names of the template's globals.
    """
    return cast(Function, Kernel(cast(Kernel, template).function, parts))


class Kernel:
    """A function that is compiled at its first call.

    Attributes:
        stand_in: makes what takes the calls of kernels that have not been called yet; None for Numba's dispatcher.
    """

    stand_in: "ClassVar[Callable[[Kernel], Callable[..., Any]] | None]" = None

    # As a slot, nothing of Python stands between a call and the compiled function: a search calls ten kernels in 50 µs.
    __slots__ = ("__call__", "__dict__", "__weakref__")
    __call__: Callable[..., Any]

    def __init__(self, function: Callable[..., Any], parts: Mapping[str, Any]):
        functools.update_wrapper(self, function)
        self.function = function
        self._parts = parts
        self.forget()

    def _call_first(self, *arguments: Any) -> Any:
        self.__call__ = self._takes_calls()
        return self.__call__(*arguments)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[object, ...]]:
        return _found, (self.function.__module__, self.function.__qualname__, dict(self._parts))

    def _takes_calls(self) -> Callable[..., Any]:
        if Kernel.stand_in is None or isinstance(self.dispatcher, FunctionType):  # Numba may be switched off
            return self.dispatcher
        return Kernel.stand_in(self)

    def forget(self) -> None:
        """Makes the next call the first one again."""
        self.__call__ = self._call_first

    @functools.cached_property
    def dispatcher(self) -> Any:
        """Numba's dispatcher."""
        if "prange" not in self.function.__code__.co_names or int(os.environ.get(THREADS, "1")) == 1:
            return self._compile("", {})
        from numba import config, prange  # noqa: PLC0415

        # OpenMP is the threading layer that is safe to enter from several threads; its idle workers spin briefly.
        config.THREADING_LAYER = "omp"  # pyright: ignore[reportAttributeAccessIssue]
        return self._compile("_divided", {"prange": prange}, parallel=True)

    def types(self, arguments: Sequence[Any]) -> tuple[Any, ...]:
        """Numba's types of arguments."""
        return tuple(map(self.dispatcher.typeof_pyval, arguments))

    def load(self, types: tuple[Any, ...]) -> bool:
        """True if there is compiled code for arguments of these types; loads it if it is in the cache."""
        if types not in self.dispatcher.overloads:
            found = self.dispatcher._cache.load_overload(types, self.dispatcher.targetctx)  # noqa: SLF001
            if found is None:
                return False
            self.dispatcher.add_overload(found)
        return True

    @functools.cached_property
    def plain(self) -> Callable[..., Any]:
        """The function as Python runs it, with the plain functions of the kernels that it calls."""
        called = {name: value.plain for name, value in self._globals.items() if isinstance(value, Kernel)}
        scope = self.function.__globals__ | self._globals | called
        return FunctionType(self.function.__code__, scope, self.function.__name__)

    @functools.cached_property
    def inlined(self) -> Callable[..., Any]:
        """Single-threaded variant, which becomes part of the kernels that call it."""
        return self._compile("_inlined", {}, **_CALLED)

    def _compile(self, suffix: str, replaced: dict[str, Any], **options: Any) -> Any:
        from numba import njit  # noqa: PLC0415

        called = {name: value.inlined for name, value in self._globals.items() if isinstance(value, Kernel)}
        scope = self.function.__globals__ | self._globals | called | replaced
        copy = FunctionType(self.function.__code__, scope, self.function.__name__)
        copy.__module__ = self.function.__module__
        copy.__qualname__ = f"{self.function.__qualname__}_{self.digest}{suffix}"
        settings: dict[str, Any] = _OPTIONS | {"fastmath": set(_FASTMATH)} | options
        try:
            compiled: Any = njit(**settings)(copy)
        except RuntimeError:  # there is no folder in which the code can be kept
            settings["cache"] = False
            return njit(**settings)(copy)
        if settings["cache"] and not isinstance(compiled, FunctionType):  # Numba may be switched off
            _tolerate_damage(compiled._cache)  # noqa: SLF001
        return compiled

    @functools.cached_property
    def size(self) -> int:
        """Length of the byte code, with that of the kernels that it calls: what it costs to compile, roughly."""
        called = (value.size for value in self._globals.values() if isinstance(value, Kernel))
        return len(self.function.__code__.co_code) + sum(called)

    @functools.cached_property
    def digest(self) -> str:
        """Hash of all that determines the machine code; its key in Numba's cache, whose own covers only the file."""
        used = ((name, value.digest if isinstance(value, Kernel) else value) for name, value in self._globals.items())
        values = sorted((name, repr(value)) for name, value in used if not (callable(value) or ismodule(value)))
        built = _FASTMATH, _OPTIONS, _CALLED
        # Machine code finds the fields of tuples by their place.
        fields = [named._fields for named in self.function.__annotations__.values() if hasattr(named, "_fields")]
        # The module, because cached code imports its modules by name.
        made_of = self.function.__module__, _readable(self.function), values, built, *fields
        return hashlib.sha256(repr(made_of).encode()).hexdigest()[:12]

    @functools.cached_property
    def _globals(self) -> dict[str, Any]:
        """Globals that the function uses, with the replaced parts."""
        used = set(self.function.__code__.co_names)
        known = self.function.__globals__ | dict(self._parts)
        return {name: value for name, value in known.items() if name in used}


def _tolerate_damage(cache: Any) -> None:
    """Lets a cache of Numba be empty where its files cannot be read, and stay as it is where the disk takes none.

    A power cut or a full disk may leave empty or cut files, with which each call would fail, for ever.
    """
    _check_content(cache._cache_file)  # noqa: SLF001
    load, save = cache.load_overload, cache.save_overload

    def load_if_whole(*key: Any) -> Any:
        try:
            return load(*key)
        except Exception:  # whatever cut bytes are to `pickle`
            with suppress(OSError):
                cache.flush()
            return None

    def save_if_possible(*key_and_code: Any) -> None:
        with suppress(OSError):
            save(*key_and_code)

    cache.load_overload, cache.save_overload = load_if_whole, save_if_possible


def _check_content(file: Any) -> None:
    """Lets machine code be loaded only as it was saved, and for what it was saved.

    Other bytes end a process without a word, for ever, or compute something else. Two processes that save at the same
    time may give the code of one the name of the other's.
    """
    save, load = file.save, file.load

    def save_data(name: str, data: Any) -> None:
        dumped: bytes = file._dump(data)  # noqa: SLF001
        with file._open_for_write(file._data_path(name)) as stream:  # noqa: SLF001
            stream.write(_checksum(dumped) + dumped)

    def load_data(name: str) -> Any:
        with open(file._data_path(name), "rb") as stream:  # noqa: SLF001
            checksum, dumped = stream.read(len(_checksum(b""))), stream.read()
        if checksum != _checksum(dumped):
            raise ValueError(f"{name} is damaged")
        return pickle.loads(dumped)  # as Numba does

    def load_own(key: Any) -> Any:
        owner, data = load(key) or (None, None)
        return data if owner == key else None

    file._save_data, file._load_data = save_data, load_data  # noqa: SLF001
    file.save, file.load = lambda key, data: save(key, (key, data)), load_own


def _checksum(data: bytes) -> bytes:
    return zlib.crc32(data).to_bytes(4, "little")


def load_compiler() -> None:
    """Imports Numba and what it needs for any kernel, which the first call does otherwise; takes half a second."""
    from numba.core.registry import cpu_target  # noqa: PLC0415

    contexts: tuple[Any, Any] = (cpu_target.typing_context, cpu_target.target_context)
    for context in contexts:
        context.refresh()


def _found(module: str, name: str, parts: Mapping[str, Any]) -> Callable[..., Any]:
    """The kernel of a module, or a composition with it; how another process finds a kernel."""
    found = functools.reduce(getattr, name.split("."), import_module(module))
    return composed(cast(Callable[..., Any], found), **parts) if parts else cast(Callable[..., Any], found)


def _readable(function: Callable[..., Any]) -> tuple[object, ...]:
    """Byte code, names and constants of a function, without its location and docstring."""
    code = function.__code__
    constants = [repr(constant) for constant in code.co_consts if constant != function.__doc__]
    return code.co_code, code.co_names, code.co_varnames, constants
