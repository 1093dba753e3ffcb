"""Meshes as a series of files: none is left that is not complete."""

import errno
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from abs_service.export import series

ESTIMATE: Any = SimpleNamespace(vertices=np.eye(3), faces=np.array([[0, 1, 2]]))


def test_a_mesh_that_a_full_disk_does_not_take_leaves_no_file(tmp_path, monkeypatch):
    def write_some(path, data):
        with open(path, "wb") as file:
            file.write(data[:10])
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_bytes", write_some)
    with pytest.raises(OSError, match="No space left"):
        series.write([ESTIMATE], tmp_path / "x.obj")
    assert list(tmp_path.iterdir()) == []
