"""The demo rig, on a port of its own, recording to a folder of its own."""

import signal

import pytest

from tests.system.running import START_S, RigListener, wait_until, write_rig


@pytest.fixture
def rig_file(tmp_path, endpoint):
    """Configuration of the demo rig."""
    return write_rig(tmp_path / "rig.toml", endpoint)


@pytest.fixture
def run(rig_file, endpoint, launch, tmp_path):
    """A rig that tracks, in a process group of its own as a terminal would make it, and somebody who listens to it."""
    output = (tmp_path / "output.jsonl").open("w", encoding="utf-8")
    process = launch("run", rig_file, "--json", stdout=output, process_group=0)
    with output, RigListener(endpoint) as listener:
        wait_until(listener.tracks_since(0), START_S, "TRACKING")
        yield process, listener
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
            process.wait(10)
