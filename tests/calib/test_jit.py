"""Kernels are put together from others, and found again in the compiler's cache by what they are made from."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from calib.jit import Kernel, composed, kernel

FACTOR = 2


@kernel
def doubled(x: float) -> float:
    """Twice x."""
    return FACTOR * x


@kernel
def squared(x: float) -> float:
    """x squared."""
    return x * x


inner = doubled


@kernel
def after(x: float) -> float:
    """One more than what another kernel says."""
    return inner(x) + 1


@kernel
def after_too(x: float) -> float:
    """The same code, said otherwise, and somewhere else."""
    return inner(x) + 1


def digest(function: object) -> str:
    return str(getattr(function, "digest"))  # noqa: B009


def test_a_composed_kernel_calls_what_it_is_given() -> None:
    assert after(3.0) == 7
    assert composed(after, inner=squared)(3.0) == 10
    assert composed(after, inner=composed(doubled, FACTOR=5))(3.0) == 16
    assert after(3.0) == 7


def test_the_same_composition_is_made_once() -> None:
    assert composed(after, inner=squared) is composed(after, inner=squared)
    assert composed(after, inner=squared) is not after


def test_what_is_compiled_is_named_by_all_that_it_is_made_from() -> None:
    variants = [after, composed(after, inner=squared), composed(after, inner=composed(doubled, FACTOR=5))]
    assert len({digest(one) for one in variants}) == 3
    assert digest(composed(after, inner=doubled)) == digest(after) == digest(after_too)


def test_code_that_has_moved_to_another_module_is_compiled_anew() -> None:
    """Compiled code imports the modules that it was made from by name."""
    moved = FunctionType(getattr(doubled, "function").__code__, globals(), "doubled")  # noqa: B009
    moved.__module__ = "calib.elsewhere"
    assert digest(kernel(moved)) != digest(doubled)


def test_a_tuple_with_its_fields_in_another_order_makes_another_kernel() -> None:
    def reading(pair: type) -> Any:
        def first(values: pair) -> float:  # pyright: ignore[reportInvalidTypeForm]
            return values.a

        return kernel(first)

    one, other = NamedTuple("Pair", [("a", float), ("b", float)]), NamedTuple("Pair", [("b", float), ("a", float)])
    assert digest(reading(one)) != digest(reading(other))


PARTS = """
from calib.jit import kernel

@kernel
def part(x: float) -> float:
    return x + {number}
"""

WHOLE = """
from calib.jit import kernel
from parts import part

@kernel
def whole(x: float) -> float:
    return 2 * part(x)

print(whole(1.0))
"""


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") != "0", reason="nothing is compiled")
def test_what_was_compiled_is_found_again_unless_something_that_it_calls_has_changed(tmp_path: Path) -> None:
    (tmp_path / "whole.py").write_text(WHOLE)

    cache = tmp_path / "cache"

    def run(number: int) -> tuple[str, dict[Path, int]]:
        """Output of the program, and times at which the files of machine code were written."""
        (tmp_path / "parts.py").write_text(PARTS.format(number=number))
        paths = f"{tmp_path}{os.pathsep}{Path(__file__).parents[2]}"
        environment = os.environ | {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(cache)}
        done = subprocess.run(
            [sys.executable, "whole.py"], cwd=tmp_path, env=environment, check=True, capture_output=True
        )
        return done.stdout.decode().strip(), {file: file.stat().st_mtime_ns for file in cache.rglob("*.nbc")}

    first, again, changed, back = (run(number) for number in (1, 1, 5, 1))
    assert [printed for printed, _ in (first, again, changed, back)] == ["4.0", "4.0", "12.0", "4.0"]
    assert first[1] == again[1]
    assert len(changed[1]) > len(again[1]) > 0
    assert back[1] == changed[1]
    for file in cache.rglob("*.nb[ic]"):
        file.write_bytes(file.read_bytes()[:40] if file.suffix == ".nbc" else b"")  # as after a power cut
    mended, found = run(1), run(1)
    assert (mended[0], found) == ("4.0", mended)
    for file in cache.rglob("*.nbc"):
        code = bytearray(file.read_bytes())
        code[500:1000] = bytes(500)  # as of a bad block: loaded, it ends the process
        file.write_bytes(code)
    assert (run(1)[0], run(1)[0]) == ("4.0", "4.0")


def test_code_that_another_process_has_saved_under_the_same_name_is_not_taken_for_ones_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))

    def halved(x: float) -> float:
        return x / 2

    one, other = kernel(halved), cast(Any, kernel(halved))
    assert (one(3.0), other(np.float32(3))) == (1.5, 1.5)
    (index,), (first, second) = tmp_path.rglob("*.nbi"), sorted(tmp_path.rglob("*.nbc"))
    second.write_bytes(first.read_bytes())
    assert index.stat().st_size
    types = Kernel(halved, {}).types((np.float32(3),))
    assert not Kernel(halved, {}).load(types)
    assert Kernel(halved, {}).load(Kernel(halved, {}).types((3.0,)))


def test_a_kernel_is_compiled_also_where_no_folder_takes_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core.caching import CacheImpl

    monkeypatch.setattr(CacheImpl, "_locator_classes", [])

    def quadrupled(x: float) -> float:
        return 4 * x

    assert kernel(quadrupled)(2.0) == 8.0


def test_a_kernel_is_compiled_also_where_the_disk_takes_no_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core.caching import IndexDataCacheFile

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(IndexDataCacheFile, "save", full)

    def tripled(x: float) -> float:
        return 3 * x

    assert kernel(tripled)(2.0) == 6.0
