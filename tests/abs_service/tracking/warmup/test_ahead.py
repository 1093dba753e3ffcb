"""Kernels that the cache lacks are compiled by other processes, while this one goes on with their plain form."""

import json
import os
import subprocess
import sys
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from abs_service.tracking.warmup.ahead import Progress
from abs_service.tracking.warmup.kernel_queue import KernelQueue
from calib.jit import Kernel

KERNELS = """
import numpy as np
from calib.jit import composed, kernel

@kernel
def double(x):
    return np.float32(2) * x

@kernel
def apply(values, out):
    for i in range(values.size):
        out[i] = double(values[i])
    return out[0]

@kernel
def half(x):
    return np.float32(0.5) * x

halved = composed(apply, double=half)

@kernel
def divide(values, out):
    out[:] = 1 / (values.size - 2)
    return values.size
"""

#: Prints results of kernels within and afterwards, and from where their code came.
PROGRAM = """
import json
import numpy as np
from abs_service.tracking.warmup.ahead import compiled_ahead
from calib.jit import kernel
from kernels import apply, divide, halved

@kernel
def local(values, out):
    out[:] = 3 * values
    return values.size

reports = []
values, results = np.array([1.5, 2.0], np.float32), []

def call():
    for one in (apply, halved, local, divide):
        out = np.empty(2, np.float32)
        returned = one(values, out)
        results.append([type(returned).__name__, returned, out.tolist()])

with compiled_ahead(lambda progress: reports.append(str(progress))) as pool:
    call()
    call()
call()
hits = [sum(one.dispatcher.stats.cache_hits.values()) for one in (apply, halved, local)]
misses = [sum(one.dispatcher.stats.cache_misses.values()) for one in (apply, halved, local)]
print(json.dumps({"results": results, "total": pool.total, "hits": hits, "misses": misses, "reports": reports}))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") != "0", reason="nothing is compiled")
def test_kernels_of_modules_are_compiled_elsewhere_and_others_here(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNELS)
    (tmp_path / "main.py").write_text(PROGRAM)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    environment = os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    (elsewhere := tmp_path / "elsewhere").mkdir()
    (elsewhere / "kernels.py").write_text("")  # another copy, in the folder where the program runs, is not the one

    def run() -> dict[str, Any]:
        command = [sys.executable, str(tmp_path / "main.py")]
        done = subprocess.run(command, env=environment, cwd=elsewhere, check=True, capture_output=True)
        return json.loads(done.stdout)

    first, second = run(), run()
    each = [["float", 3.0, [3.0, 4.0]], ["float", 0.75, [0.75, 1.0]], ["int", 2, [4.5, 6.0]]]
    each.append(["int", 2, 2 * [inf]])  # which Python refuses to compute
    assert first["results"] == second["results"] == 3 * each
    assert first["total"] == 4
    assert first["reports"][0].startswith("0 of 4")
    assert first["misses"] == [0, 0, 1]  # a program's own kernels are in no module that another process could import
    assert second["total"] == 0
    assert second["misses"] == [0, 0, 0]


def test_progress_says_how_many_and_how_long() -> None:
    assert str(Progress(0, 31, inf)) == "0 of 31"
    assert str(Progress(12, 31, 9.5)) == "12 of 31, about 10 s"
    assert str(Progress(30, 31, 0.2)) == "30 of 31, about 1 s"


def test_the_largest_kernel_is_compiled_first_and_the_rest_is_judged_by_size() -> None:
    now_s = 100.0
    queue = KernelQueue(lambda: now_s)
    for size in (10, 40, 150, 1):
        queue.put((cast(Kernel, SimpleNamespace(size=size, digest=str(size))), ()))
    assert queue.left_s == inf
    taken = [cast(Any, queue.take())[0] for _ in range(4)]
    assert [kernel.size for kernel in taken] == [150, 40, 10, 1]
    now_s += 0.2
    queue.finish(taken[3])
    assert queue.left_s == inf, "so little tells nothing: a start on a busy machine began with 3279 s"
    now_s += 29.8
    queue.finish(taken[0])
    assert queue.left_s == pytest.approx(30 * 50 / 151)
    assert (queue.done, queue.total) == (2, 4)
    queue.close()
    assert queue.take() is None
