"""One tracker, its sensors captured on two hosts: network and time namespaces, whole processes."""

import subprocess
import sys
import time
from contextlib import ExitStack

import pytest
import tomli_w
from absmsg.v1.deformation_state_pb2 import DeformationState

from evaluation.experiment import UnavailableError
from evaluation.service.faults import network
from evaluation.service.faults.hosts import await_port
from evaluation.service.live.rig import demo_table
from tests.system.running import START_S, RigListener

ENDPOINT = f"tcp/{network.ADDRESS}:7447"
#: The colour host's clock is ahead by this [s].
AHEAD_S = 3600


def write(path, *sensors):
    """The demo rig with some of its sensors only."""
    rig = demo_table("demo")
    rig["bus"]["endpoint"] = ENDPOINT
    rig["devices"]["sim"]["uri"] = f"simulated://sheet?seed=1&sensors={','.join(sensors)}"
    rig["sensors"] = {name: table for name, table in rig["sensors"].items() if name in sensors}
    rig["synchronisation"]["tolerance_ms"] = 16.0  # two simulations begin when they like: up to half a period apart
    if len(sensors) == 1:
        del rig["trackers"], rig["synchronisation"]
    path.write_text(tomli_w.dumps(rig), encoding="utf-8")
    return path


def start(stack, log, *words):
    process = subprocess.Popen(words, stdout=log, stderr=log)
    stack.callback(process.wait)
    stack.callback(process.kill)
    return process


def program(command, rig, option):
    return (sys.executable, "-m", "abs_service", command, str(rig), option, ENDPOINT)


def await_true(condition, timeout_s, message):
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, message()
        time.sleep(0.2)


pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(300)]


@pytest.fixture
def hosts():
    if subprocess.run(["unshare", "--time", "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may not make time namespaces")
    with ExitStack() as stack:
        try:
            stack.enter_context(network.two_hosts())
        except UnavailableError as error:
            pytest.skip(str(error))
        yield stack


def test_sensors_of_two_hosts_whose_clocks_differ_by_an_hour_are_tracked_together(hosts, tmp_path):
    log = hosts.enter_context((tmp_path / "log").open("wb"))
    depth, color = write(tmp_path / "depth.toml", "tof"), write(tmp_path / "color.toml", "color")
    inside = ("ip", "netns", "exec")
    ahead = ("unshare", "--time", "--monotonic", str(AHEAD_S))
    start(hosts, log, *inside, network.CAMERAS, *program("capture", depth, "--listen"))
    await_port(ENDPOINT)
    start(hosts, log, *inside, network.TRACKING, *ahead, *program("capture", color, "--connect"))
    start(hosts, log, *program("track", write(tmp_path / "rig.toml", "tof", "color"), "--connect"))
    listener = hosts.enter_context(RigListener(ENDPOINT, "sheet/state"))

    def paired():
        states = [DeformationState.FromString(one.sample.payload) for one in listener.received[-10:]]
        return len(states) == 10 and not any(sensor.missing for state in states for sensor in state.sensors)

    def said():
        return f"{len(listener.received)} states; {(tmp_path / 'log').read_text()[-2000:]}"

    await_true(paired, START_S, said)
