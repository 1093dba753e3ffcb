"""A rig that another host captures is tracked and recorded by `run --connect`, also after that host was away."""

import signal
import time

import pytest
from absmsg.v1.health_pb2 import Health

import abs_service
from tests.ports import free_port
from tests.system.running import START_S, RigListener, kill, wait_until, write_rig

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


def test_what_one_host_captures_another_tracks_and_records(endpoint, launch, tmp_path):
    far = f"tcp/127.0.0.1:{free_port()}"
    rig = write_rig(tmp_path / "rig.toml", endpoint)  # one file for both
    capture = launch("capture", rig, "--listen", far)
    process = launch("run", rig, "--connect", far)
    with RigListener(endpoint) as listener:
        wait_until(listener.tracks_since(0, 30), START_S, "TRACKING from afar")
        kill(capture.pid)
        wait_until(lambda: _level(listener) == Health.LEVEL_ERROR, 15, "noticing that nothing comes any more")
        assert process.poll() is None, "a rig waits for the host that captures"
        begun_ns = time.monotonic_ns()
        launch("capture", rig, "--listen", far)
        wait_until(listener.tracks_since(begun_ns, 20), START_S, "TRACKING again")
        counters = listener.health("run")[-1].counters
    process.send_signal(signal.SIGTERM)
    assert process.wait(15) == 0
    assert not any(number for name, number in counters.items() if name.startswith("restarts")), (
        "its own processes went on all the time"
    )
    (file,) = (tmp_path / "takes").glob("*.mcap")
    assert len(list(abs_service.open_recording(file).images())) > 50, "before and after"


def _level(listener):
    return listener.health("run")[-1].level if listener.health("run") else Health.LEVEL_OK
