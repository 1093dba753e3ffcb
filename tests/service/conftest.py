"""A real zenoh router on a free port of the loopback interface, and clients of it."""

import os
import signal
import socket
import subprocess
import sys

import pytest

from abs_service.bus.session import Role
from abs_service.bus.zenoh_bus import ZenohBus


@pytest.fixture
def endpoint():
    """An address on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def launch():
    """Starts `abs-service ARGUMENTS` as a process of its own; whatever still runs after the test is killed."""
    started = []

    def launch(*arguments, **settings):
        process = subprocess.Popen(
            [sys.executable, "-m", "abs_service", *map(str, arguments)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            stderr=subprocess.PIPE,
            text=True,
            **settings,
        )
        started.append(process)
        return process

    yield launch
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.communicate()


@pytest.fixture
def open_bus(endpoint):
    """Opens buses of the rig "demo"; the first is the router. All are closed after the test."""
    opened = []

    def open_bus():
        opened.append(ZenohBus.open("demo", endpoint, Role.CLIENT if opened else Role.ROUTER))
        return opened[-1]

    yield open_bus
    for bus in reversed(opened):
        bus.close()
