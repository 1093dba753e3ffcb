"""A process that compiles a model's kernels computes what a process computes that loads them, to the last bit."""

import os
import subprocess
import sys

import pytest

#: A kernel that calls kernels that call others; some are too large to be inlined unless that is demanded.
PROGRAM = """
import numpy as np
from abs_service.tracker.models.parts.bspline_patches import Patches

u, w = (grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(0, 1, 20)]))
surface = Patches(u, w, np.zeros(400), np.ones((3, 3)), 2).deform(np.random.default_rng(0).normal(size=(3, 27)))
print(surface.vertices.tobytes().hex(), surface.normals.tobytes().hex())
"""


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") != "0", reason="nothing is compiled")
def test_compiled_and_loaded_kernels_round_alike(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    compiled, loaded = (
        subprocess.run([sys.executable, "-c", PROGRAM], env=environment, check=True, capture_output=True).stdout
        for _ in range(2)
    )
    assert compiled == loaded
