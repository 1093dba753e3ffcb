"""Messages that are overwritten in shared memory while their reader stands still are counted, and never read."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from abs_service.bus import session
from abs_service.bus.contract import MESH
from tests.waiting import eventually, repeating

#: A reader that is busy with its first message until a line comes; then it says what it got.
READER = """
import json, sys, threading
from abs_client.connection.link import Link

released, arrived = threading.Event(), []

def on_message(one):
    if not arrived:
        print("busy", flush=True)
        released.wait()
    arrived.append(len(set(one.payload)))

with Link(sys.argv[1], "demo") as link:
    link.subscribe("sheet/mesh", on_message)
    print("ready", flush=True)
    sys.stdin.readline()
    released.set()
    sys.stdin.readline()
    print(json.dumps([arrived, sum(link.malformed.values())]), flush=True)
"""
#: More than messages that zenoh sends through sockets in any case [bytes].
SIZE = 30_000
#: Much longer than zenoh waits for a reader of shared memory [s].
STOPPED_S = 0.4
#: Messages until more than four wait in the queue of the reader, and until the memory of these is used again.
QUEUED, OVERWRITING = 20, 150


@pytest.mark.skipif(not session.pool_bytes(), reason="shared memory is not used here")
def test_a_client_that_stood_still_leaves_out_and_counts_what_was_overwritten(open_bus, endpoint):
    open_bus().subscribe("sheet/state", lambda sample: None)
    bus = open_bus()
    mesh, state = (bus.publisher(f"sheet/{topic}", "x", MESH) for topic in ("mesh", "state"))
    sent = []

    def publish(publisher):
        publisher.put(bytes([len(sent) % 256]) * SIZE)
        sent.append(publisher)

    command = [sys.executable, "-c", READER, endpoint]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as reader:
        assert reader.stdin
        assert reader.stdout
        try:
            assert reader.stdout.readline() == "ready\n"
            with repeating(lambda: publish(mesh), 0.01):
                assert reader.stdout.readline() == "busy\n"
                before = len(sent)
                assert eventually(lambda: len(sent) >= before + QUEUED)  # as many as it keeps wait by now
            reader.send_signal(signal.SIGSTOP)
            with repeating(lambda: publish(state), 0.002):
                time.sleep(STOPPED_S)
                assert eventually(lambda: sent.count(state) >= OVERWRITING)
            reader.send_signal(signal.SIGCONT)
            for _ in range(2):
                print(file=reader.stdin, flush=True)
                time.sleep(0.3)
            arrived, malformed = json.loads(reader.stdout.readline())
        finally:
            reader.kill()
    assert set(arrived) == {1}, "bytes of several messages in one"
    assert malformed > 0
