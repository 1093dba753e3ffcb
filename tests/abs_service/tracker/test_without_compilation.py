"""Kernels as plain Python, where coverage and debuggers can follow, compute the same."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.abs_service.tracker.synthesis.random_vertices import INTERPRETED

HERE = Path(__file__).parent
FILES = (HERE / "synthesis" / "test_sparse_kernels.py", HERE / "terms" / "depth" / "test_cost_kernels.py")


@pytest.mark.slow
@pytest.mark.skipif(INTERPRETED, reason="this is the run without compilation")
def test_kernels_hold_without_compilation():
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "ignore::RuntimeWarning", *FILES]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    outcome = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert outcome.returncode == 0, outcome.stdout[-4000:] + outcome.stderr[-2000:]
