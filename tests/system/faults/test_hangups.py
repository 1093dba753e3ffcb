"""SIGHUP to a service that starts, and with SIGUSR1 and SIGUSR2 to all processes of one that runs, as by `pkill`."""

import os
import signal
import subprocess
import time

import pytest

from evaluation.service.live.proc import children, every_child
from tests.system.running import START_S, RigListener, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


@pytest.fixture(autouse=True)
def default_hangup():
    """SIGHUP as a shell leaves it to programs; they inherit that it is ignored, as under `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


def test_a_service_reads_its_file_again_and_none_of_its_processes_ends(rig_file, endpoint, launch):
    process = launch("run", rig_file, "--no-record", "--json", stdout=subprocess.DEVNULL, start_new_session=True)
    wait_until(lambda: children(process.pid), 10, "a fork server")
    process.send_signal(signal.SIGHUP)  # the bus is not yet open
    with RigListener(endpoint) as listener:
        wait_until(listener.tracks_since(0), START_S, "TRACKING")
        first = children(process.pid)["fork-server"]  # a later one has not inherited what `run` blocks as it starts
        os.kill(first, signal.SIGKILL)
        wait_until(lambda: children(process.pid).get("fork-server", first) != first, 10, "another fork server")
        alive = every_child(process.pid)
        assert {"fork-server", "capture", "track"} <= {command for command, _ in alive}
        for pid in [process.pid, *(pid for _, pid in alive)]:
            for number in (signal.SIGUSR1, signal.SIGUSR2, signal.SIGHUP):
                os.kill(pid, number)
        wait_until(listener.tracks_since(time.monotonic_ns() + 2 * 10**9), 20, "TRACKING afterwards")
        assert every_child(process.pid) == alive
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 0, said
    assert said.count("accepted") >= 2, said
