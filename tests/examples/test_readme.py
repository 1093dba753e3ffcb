"""The Python of the README does what it says, and prints what one can read."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import abs_client
import numpy as np
from abs_client.estimates.state import State, Status
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")

#: Most characters in what one turn of a loop prints: two lines of a terminal.
MAX_LENGTH = 320


def test_ten_lines_say_why_nothing_is_tracked(capsys):
    empty = np.full((480, 640), np.nan, np.float32), np.zeros((480, 640, 3), np.uint8)
    run("Ten lines of Python", frames=[(0.0, *empty)])
    printed = capsys.readouterr().out
    assert "INITIALIZING" in printed
    assert re.search(r"\('.+'", printed)
    assert len(printed) < MAX_LENGTH


def test_the_subscriber_prints_numbers_one_can_read(capsys, monkeypatch):
    monkeypatch.setattr(abs_client, "subscribe", lambda *_, **__: states())
    run("Subscribe")
    stale, tracking = capsys.readouterr().out.split("TRACKING")
    assert "STALE ('nothing was received',)" in stale
    assert "(287, 3)" in tracking
    assert len(tracking) < MAX_LENGTH


def run(section: str, **given: Any) -> None:
    """Runs the Python of a section."""
    code = README.partition(f"## {section}\n")[2].partition("```python\n")[2].partition("```")[0]
    exec(compile(code, "README.md", "exec"), given)


def states() -> Iterator[State]:
    """States before the first estimate, and an estimate of 287 vertices."""
    yield State(DeformationState(), DeformedMesh(), MeshTopology(), Status.STALE, ("nothing was received",), math.nan)
    vertices, covariance = np.zeros((287, 3), "<f4"), np.zeros((287, 6), "<f4")
    mesh = DeformedMesh(vertices_f32=vertices.tobytes(), covariance_f32=covariance.tobytes())
    yield State(DeformationState(theta=[0.0] * 48), mesh, MeshTopology(), Status.TRACKING, (), 0.02)
