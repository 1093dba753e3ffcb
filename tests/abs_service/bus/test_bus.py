"""The bus on real sessions: what arrives, what does not block, and which errors are understood."""

import gc
import queue
import subprocess
import sys
import threading
import time
from typing import Any

import pytest
import zenoh

from abs_service.bus import zenoh_bus
from abs_service.bus.contract import EVENTS, IMAGES, STATE, Sample
from abs_service.bus.session import BusError, Role, check_endpoint, open_session
from abs_service.bus.zenoh_bus import ZenohBus


def listen(bus, pattern):
    arrived = queue.SimpleQueue()
    bus.subscribe(pattern, arrived.put)
    return arrived


@pytest.fixture
def buses(open_bus):
    """A router and two of its clients."""
    return open_bus(), open_bus(), open_bus()


def publish_until_received(publisher, arrived, *message):
    """Subscriptions travel to publishers on their own time."""
    for _ in range(200):
        publisher.put(*message)
        try:
            return arrived.get(timeout=0.05)
        except queue.Empty:
            continue
    raise AssertionError("nothing arrived within ten seconds")


@pytest.mark.parametrize("qos", [STATE, EVENTS, IMAGES])
def test_a_message_arrives_as_it_was_sent(buses, qos):
    _, sender, receiver = buses
    arrived = listen(receiver, "**")
    payload = bytes(range(256)) * 1000
    publisher = sender.publisher("tof/depth/image", "foxglove.RawImage", qos)
    sample = publish_until_received(publisher, arrived, payload, b"info")
    assert sample == Sample("tof/depth/image", "foxglove.RawImage", payload, b"info")
    bare = sender.publisher("tf", "foxglove.FrameTransforms", qos)
    assert publish_until_received(bare, listen(receiver, "tf"), b"") == Sample(
        "tf", "foxglove.FrameTransforms", b"", b""
    )


def test_a_latched_publisher_answers_queries_with_its_last_message(buses):
    _, sender, receiver = buses
    publisher = sender.latched_publisher("config", "absmsg.v1.Config")
    assert receiver.query("config", 1) == []
    arrived = listen(receiver, "config")
    publish_until_received(publisher, arrived, b"old")
    publisher.put(b"new")
    assert receiver.query("**", 1) == [Sample("config", "absmsg.v1.Config", b"new")]


def test_queries_are_answered_when_they_arrive(buses):
    _, sender, receiver = buses
    sender.answer_queries("schema", "google.protobuf.FileDescriptorSet", lambda: b"files")
    answers = []
    while not answers:
        answers = receiver.query("schema", 1)
    assert answers == [Sample("schema", "google.protobuf.FileDescriptorSet", b"files")]


def test_components_come_and_go(buses):
    _, one, two = buses
    changes = queue.SimpleQueue()
    token = one.declare_liveliness("track/sheet")
    two.watch_liveliness(lambda *change: changes.put(change))
    assert changes.get(timeout=5) == ("track/sheet", True)
    token.close()
    assert changes.get(timeout=5) == ("track/sheet", False)
    one.declare_liveliness("capture")
    assert changes.get(timeout=5) == ("capture", True)
    gc.collect()
    with pytest.raises(queue.Empty):
        changes.get(timeout=0.3)  # nobody has to hold on to what was declared
    one.close()
    assert changes.get(timeout=5) == ("capture", False)


@pytest.fixture
def blocked():
    """A callback that returns once the test is over, and the messages that it began with."""
    begun, release = queue.SimpleQueue(), threading.Event()

    def callback(sample):
        begun.put(sample)
        release.wait()

    yield callback, begun
    release.set()


def test_a_slow_subscriber_neither_blocks_the_publisher_nor_others(buses, blocked):
    router, sender, receiver = buses
    callback, begun = blocked
    router.subscribe("tof/depth/image", callback)
    arrived = listen(receiver, "tof/depth/image")
    publisher = sender.publisher("tof/depth/image", "foxglove.RawImage", IMAGES)
    publish_until_received(publisher, arrived, b"first")
    while begun.empty():
        publish_until_received(publisher, arrived, b"first")
    for number in range(60):
        publisher.put(bytes(100_000), str(number).encode())
        publish_until_received(publisher, arrived, bytes(100_000), str(number).encode())
    assert begun.qsize() == 1, "all others arrived while the slow subscriber still handles its first message"


def test_a_stopped_subscriber_does_not_block_the_publisher(buses, endpoint):
    _, sender, receiver = buses
    program = f"""
import time
from abs_service.bus.session import Role
from abs_service.bus.zenoh_bus import ZenohBus
with ZenohBus.open("demo", "{endpoint}", Role.CLIENT) as bus:
    bus.subscribe("**", lambda sample: None)
    bus.declare_liveliness("stopped")
    print("ready", flush=True)
    time.sleep(60)
"""
    alive = queue.SimpleQueue()
    receiver.watch_liveliness(lambda *change: alive.put(change))
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
            assert alive.get(timeout=5) == ("stopped", True)
            arrived = listen(receiver, "tof/depth/image")
            publisher = sender.publisher("tof/depth/image", "foxglove.RawImage", IMAGES)
            publish_until_received(publisher, arrived, b"first")
            process.send_signal(19)  # SIGSTOP
            slowest = 0.0
            for _ in range(100):
                before = time.perf_counter()
                publisher.put(bytes(1_000_000))
                slowest = max(slowest, time.perf_counter() - before)
                time.sleep(0.01)
            assert slowest < 0.5
            assert alive.get(timeout=10) == ("stopped", False), "the lease shall end what does not answer"
        finally:
            process.kill()


def test_everything_resumes_when_the_router_comes_back(buses, endpoint):
    router, sender, receiver = buses
    arrived = listen(receiver, "sheet/state")
    publisher = sender.publisher("sheet/state", "absmsg.v1.DeformationState", STATE)
    sender.latched_publisher("config", "absmsg.v1.Config").put(b"answer")
    publish_until_received(publisher, arrived, b"before")
    router.close()
    publisher.put(b"nobody hears this, and nothing blocks")
    with ZenohBus.open("demo", endpoint, Role.ROUTER):
        while publish_until_received(publisher, arrived, b"after").payload != b"after":
            pass
        while not (answers := receiver.query("config", 1)):
            pass
        assert answers[0].payload == b"answer"


@pytest.mark.parametrize(
    "endpoint", ["", "7447", "tcp/127.0.0.1", "tcp/127.0.0.1:99999", "tcp/127.0.0.1:0", "ftp/127.0.0.1:1", "tcp/a b:1"]
)
@pytest.mark.parametrize("role", Role)
def test_a_malformed_endpoint_is_explained(endpoint, role):
    with pytest.raises(BusError, match=r'bus\.endpoint = ".*": not an endpoint; write PROTOCOL/HOST:PORT'):
        open_session(endpoint, role)


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:7447", "tls/host.example:1", "tcp/[::1]:65535", "ws/a:1?x=1#y"])
def test_endpoints_that_are_fine(endpoint):
    assert check_endpoint(endpoint) == endpoint


def test_a_port_in_use_is_explained(open_bus, endpoint):
    open_bus()
    with pytest.raises(BusError, match=f'bus.endpoint = "{endpoint}": the address is in use'):
        open_session(endpoint, Role.ROUTER)


def test_a_router_that_is_not_there_is_explained(endpoint, monkeypatch):
    monkeypatch.setattr("abs_service.bus.session.CONNECT_TIMEOUT_MS", 200)
    with pytest.raises(BusError, match=f'bus.endpoint = "{endpoint}": nothing answers there'):
        open_session(endpoint, Role.CLIENT)


def test_an_unknown_host_is_explained_without_the_source_of_zenoh():
    with pytest.raises(BusError, match="cannot listen there") as error:
        open_session("tcp/no-such-host.invalid:7447", Role.ROUTER)
    assert ".rs" not in str(error.value)


def test_a_process_with_everything_declared_ends_at_once(endpoint):
    program = f"""
from abs_service.bus.contract import STATE
from abs_service.bus.session import Role
from abs_service.bus.zenoh_bus import ZenohBus
with ZenohBus.open("demo", "{endpoint}", Role.ROUTER) as bus:
    bus.subscribe("**", print)
    bus.watch_liveliness(print)
    bus.latched_publisher("config", "absmsg.v1.Config").put(b"x")
    bus.publisher("sheet/state", "absmsg.v1.DeformationState", STATE).put(b"y")
"""
    ended = subprocess.run([sys.executable, "-c", program], check=False, timeout=10, stdout=subprocess.DEVNULL)
    assert ended.returncode == 0


def test_closing_twice_is_fine(endpoint):
    bus = ZenohBus.open("demo", endpoint, Role.ROUTER, shared_memory=False)
    bus.close()
    bus.close()
    with ZenohBus.open("demo", endpoint, Role.ROUTER) as again:  # which it can only once the endpoint is free
        assert list(again.query("**", 0.1)) == []


def test_a_callback_that_does_not_return_is_left_behind_with_a_warning(caplog):
    class Session:
        def is_closed(self) -> bool:
            return False

        def close(self):
            raise zenoh.ZError("close operation timed out!")

    session: Any = Session()
    ZenohBus(session, "demo").close()
    assert "rig demo: the session did not close, a callback has not returned" in caplog.text


def test_closing_ends_within_a_second_whatever_a_callback_does(caplog, monkeypatch):
    monkeypatch.setattr(zenoh_bus, "CLOSE_S", 0.05)
    returns = threading.Event()

    class Session:
        def is_closed(self) -> bool:
            return False

        def close(self):
            returns.wait()

    session: Any = Session()
    ZenohBus(session, "demo").close()
    assert not returns.is_set()
    assert "a callback has not returned: no answer within" in caplog.text
    returns.set()


@pytest.mark.slow
def test_a_process_ends_though_a_callback_waits_for_ever(endpoint):
    program = f"""
import threading
from abs_service import cli
from abs_service.bus.contract import EVENTS
from abs_service.bus.session import Role
from abs_service.bus.zenoh_bus import ZenohBus

def main():
    entered = threading.Event()
    def wait_for_ever(sample):
        entered.set()
        threading.Event().wait()
    with ZenohBus.open("demo", "{endpoint}", Role.ROUTER) as bus:
        bus.subscribe("x", wait_for_ever)
        publisher = bus.publisher("x", "m", EVENTS)
        while not entered.wait(0.02):
            publisher.put(b"")
    print("done")
    return 7

cli.main = main
cli.program()
"""
    ended = subprocess.run([sys.executable, "-c", program], check=False, timeout=20, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (7, "done\n")
    assert "left behind, since they do not end: " in ended.stderr


def test_the_interpreter_waits_for_callbacks_that_a_daemon_declared(open_bus):
    bus = open_bus()
    before = set(threading.enumerate())

    def declare():
        bus.latched_publisher("config", "absmsg.v1.Config")
        bus.answer_queries("schema", "bytes", bytes)
        bus.subscribe("**", lambda sample: None)
        bus.watch_liveliness(lambda component, alive: None)

    daemon = threading.Thread(target=declare, daemon=True)
    daemon.start()
    daemon.join()
    callbacks = set(threading.enumerate()) - before
    assert len(callbacks) == 4
    assert not any(thread.daemon for thread in callbacks)
    bus.close()
    for thread in callbacks:
        thread.join(5)
        assert not thread.is_alive()
