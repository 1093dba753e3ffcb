"""A rig captured by one process is tracked by another, also after a reconnection."""

import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from tests.ports import free_port
from tests.system.running import START_S, RigListener, kill, wait_until, write_rig

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


def write(path: Path, endpoint: str, **changes: tuple[str, str]) -> Path:
    text = write_rig(path, endpoint).read_text("utf-8")
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, "utf-8")
    return path


def test_what_one_process_captures_another_tracks(endpoint, launch, tmp_path):
    far = f"127.0.0.1:{free_port()}"
    name, uri = ('name = "demo"', 'name = "cameras"'), 'uri = "simulated://sheet?seed=1"'
    cameras = write(
        tmp_path / "cameras.toml", f"tcp/{far}", name=name, uri=(uri, uri.replace("seed=1", "seed=1&rate=10&speed=0.2"))
    )
    rig = write(tmp_path / "rig.toml", endpoint, uri=(uri, f'uri = "remote://{far}/cameras"'))
    capture = launch("capture", cameras, "--listen", f"tcp/{far}")
    output = tmp_path / "output.jsonl"
    with output.open("w", encoding="utf-8") as stream:
        process = launch("run", rig, "--json", "--no-record", stdout=stream)
        with RigListener(endpoint) as listener:
            wait_until(listener.tracks_since(0, 30), START_S, "TRACKING from afar")
            lost_ns = kill(capture.pid)
            wait_until(lambda: _state(listener) == "reconnecting", 15, "noticing that the other process is gone")
            launch("capture", cameras, "--listen", f"tcp/{far}")
            wait_until(lambda: _state(listener) == "streaming", START_S, "reconnecting")
            wait_until(listener.tracks_since(time.monotonic_ns(), 20), START_S, "TRACKING again")
            frames = listener.frames("tof/depth/image")
        process.send_signal(signal.SIGTERM)
        assert process.wait(15) == 0
    epochs = sorted({frame.epoch for frame in frames})
    assert len(epochs) >= 2
    assert all(frame.epoch == epochs[0] for frame in frames if frame.header.t_host_ns < lost_ns)
    # One clock, so the stamps are those of the exposures, and the truth of the same moment is known.
    assert all(frame.t_sigma_ns == 0 for frame in frames)
    estimates = [json.loads(line) for line in output.read_text("utf-8").splitlines()]
    errors = [estimate["error_mm"] for estimate in estimates if estimate.get("error_mm") is not None]
    assert len(errors) > 20, f"{len(errors)} errors of {len(estimates)} estimates"
    assert np.median(errors) < 3


def _state(listener: RigListener) -> str:
    said = listener.health("capture")
    return said[-1].labels.get("device.sim", "") if said else ""
