"""Subscribers that stand still, as after SIGSTOP, keep nobody else from the router, however long they do."""

import signal
import subprocess
import sys
import time
from contextlib import closing

import pytest

from abs_service.bus.session import SessionMode, open_session

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

PEERS, SECONDS = 6, 15  # longer than the lease of 10 s that zenoh has by default
ROUTER = """
import sys, time
from abs_service.bus.session import SessionMode, open_session
session = open_session(sys.argv[1], SessionMode.ROUTER, shared_memory=False)
print("ready", flush=True)
time.sleep(60)
"""
PEER = """
import json, sys, time, zenoh
settings = {"mode": "client", "connect": {"endpoints": [sys.argv[1]]}}
session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
subscriber = session.declare_subscriber("a", lambda sample: None)
print("ready", flush=True)
time.sleep(60)
"""


def test_six_stopped_subscribers_keep_nobody_from_the_router(endpoint):
    processes = []
    try:
        for code in (ROUTER, *[PEER] * PEERS):
            process = subprocess.Popen([sys.executable, "-c", code, endpoint], stdout=subprocess.PIPE, text=True)
            processes.append(process)
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
        with (
            closing(open_session(endpoint, SessionMode.CLIENT, shared_memory=False)) as sender,
            closing(open_session(endpoint, SessionMode.CLIENT, shared_memory=False)) as receiver,
        ):
            arrived = []
            subscriber = receiver.declare_subscriber("a", lambda sample: arrived.append(time.monotonic()))
            for process in processes[1:]:
                process.send_signal(signal.SIGSTOP)
            end = time.monotonic() + SECONDS
            while time.monotonic() < end:
                sender.put("a", bytes(400_000))
                time.sleep(0.1)
            assert max(b - a for a, b in zip(arrived, [*arrived[1:], time.monotonic()])) < 2.0
            subscriber.undeclare()
            for process in processes:
                process.kill()
    finally:
        for process in processes:
            process.kill()
            process.communicate()
