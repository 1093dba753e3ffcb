"""Programs that stand still, as after SIGSTOP, or say nothing, keep nobody else from the router."""

import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, closing

import pytest

from abs_service.bus.session import SessionMode, open_session

PEERS, SECONDS = 40, 25  # longer than the lease of 10 s that zenoh has by default, and than it would wait for a socket
ROUTER = """
import sys, time
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
with ZenohBus.open("demo", sys.argv[1], SessionMode.ROUTER, shared_memory=False):
    print("ready", flush=True)
    time.sleep(60)
"""
PEER = """
import json, sys, time, zenoh
settings = json.dumps({"mode": "client", "connect": {"endpoints": [sys.argv[1]]}})
sessions = [zenoh.open(zenoh.Config.from_json5(settings)) for _ in range(int(sys.argv[2]))]
subscribers = [session.declare_subscriber("a", lambda sample: None) for session in sessions]
print("ready", flush=True)
time.sleep(60)
"""


@pytest.mark.slow
def test_forty_stopped_subscribers_keep_nobody_from_the_router(endpoint):
    processes = []
    try:
        for code in (ROUTER, PEER):
            command = [sys.executable, "-c", code, endpoint, str(PEERS)]
            processes.append(process := subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
        with closing(client(endpoint)) as sender, closing(client(endpoint)) as receiver:
            arrived = []
            subscriber = receiver.declare_subscriber("a", lambda sample: arrived.append(time.monotonic()))
            processes[1].send_signal(signal.SIGSTOP)
            end = time.monotonic() + SECONDS
            while time.monotonic() < end:
                for _ in range(10):
                    sender.put("a", bytes(400_000))
                    time.sleep(0.1)
                client(endpoint).close()  # others still get in
            assert max(b - a for a, b in zip(arrived, [*arrived[1:], time.monotonic()])) < 5.0
            subscriber.undeclare()
            for process in processes:
                process.kill()
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def test_a_hundred_connections_that_say_nothing_keep_nobody_from_the_router(open_bus, endpoint):
    open_bus()
    host, _, port = endpoint.removeprefix("tcp/").partition(":")
    with ExitStack() as stack:
        for _ in range(120):  # zenoh lets a hundred of them wait, for 10 s
            stack.enter_context(socket.create_connection((host, int(port))))
        with closing(client(endpoint)) as session:
            assert len(session.info.routers_zid()) == 1


def client(endpoint):
    return open_session(endpoint, SessionMode.CLIENT, shared_memory=False)
