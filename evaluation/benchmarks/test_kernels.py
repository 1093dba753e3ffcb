"""Time to deform, synthesise and score; see `kernels`. Each number of threads has its own process."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calib import jit
from evaluation.benchmarks import kernels
from evaluation.benchmarks.conftest import KEY

ROOT = Path(__file__).parents[2]

#: Costs of candidates, printed so that no digit is lost.
COSTS = """
import json
from evaluation.benchmarks import kernels
model = kernels.nurbs_of((4, 4))
surface = model.deform(kernels.population(model))
print(json.dumps([list(kernels.objective_of(model, (head,)).cost(surface)) for head in ("tof", "color")]))
"""


def printed_by(arguments: list[str], threads: int) -> str:
    """Output of Python in a process whose kernels use `threads` threads."""
    paths = os.pathsep.join([str(ROOT), str(ROOT / "proto")])
    environment = os.environ | {jit.THREADS: str(threads), "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": paths}
    command = [sys.executable, *arguments]
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout


@pytest.mark.slow
@pytest.mark.timeout(1800)  # compiling for two threads takes most of it
def test_kernels(benchmark):
    rounds = 1 if benchmark.disabled else 100
    counts = (1,) if benchmark.disabled else (1, 2)
    arguments = ["-m", "evaluation.benchmarks.kernels", "--rounds", str(rounds)]
    measured = {threads: json.loads(printed_by(arguments, threads)) for threads in counts}
    rows = {part: {str(threads): measured[threads][part] for threads in counts} for part in measured[1]}
    benchmark.extra_info[KEY] = {"yardstick": rows.pop("yardstick"), **rows}
    benchmark.pedantic(lambda: None, rounds=1)
    assert all(ns > 0 for times in rows.values() for ns in times.values())


@pytest.mark.slow
def test_costs_do_not_depend_on_the_number_of_threads():
    one, two = (np.array(json.loads(printed_by(["-c", COSTS], threads))) for threads in (1, 2))
    assert one.shape == (2, kernels.POPULATION)
    np.testing.assert_allclose(two, one, rtol=1e-6)
