"""Frames per second at the paper's full budgets and with `hybrid`, with one and two threads; see `rates`."""

import json
import os
import subprocess
import sys

import pytest

from calib import jit
from evaluation.benchmarks import rates

THREADS = (1, 2)


@pytest.mark.timeout(1200)
def test_frames(benchmark):
    if benchmark.disabled:
        pytest.skip("its parts are tested below")
    for threads in THREADS:
        # Processes of their own: the number of threads is that of a process.
        environment = os.environ | {jit.THREADS: str(threads)}
        command = [sys.executable, "-m", "evaluation.benchmarks.rates"]
        printed = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
        benchmark.extra_info.setdefault("frames", {})[str(threads)] = json.loads(printed)
    benchmark.pedantic(lambda: None, rounds=1)


def test_a_search_s_own_time_is_a_part_of_its_frame_s():
    found = rates.measure(next(rates.cases(0.01)), 2)
    assert 0 < found["cpu_ms"] <= found["cpu_p95_ms"]
    assert 0 < found["search_share"] < 1
