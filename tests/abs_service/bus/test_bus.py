"""The bus on real sessions: messages, queries and tokens arrive, and a slow subscriber blocks no others."""

import gc
import queue
import subprocess
import sys
import threading
import time

import pytest

from abs_service.bus.contract import EVENTS, IMAGES, STATE, Sample
from abs_service.bus.health import Health
from abs_service.bus.session import SessionMode, open_session
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.wire.checked_bus import CheckedBus


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


@pytest.mark.parametrize("key", ["abs/**", "**", "abs/demo", "abs/*/tof/depth/image"])
def test_a_key_with_wildcards_is_refused_as_no_topic(open_bus, endpoint, key):
    open_bus()
    with CheckedBus(open_bus(), time.monotonic_ns) as receiver, open_session(endpoint, SessionMode.CLIENT) as stranger:
        listen(receiver, "**")
        health = Health(receiver, "run", HeaderFactory("demo", WallClock()))
        for _ in range(200):
            stranger.put(key, b"")
            receiver.report(health)
            if receiver.trouble:
                break
            time.sleep(0.05)
    assert health.counted("refused.topic") > 1


def next_after(arrived, earlier):
    """The next message that is not a repetition of `earlier`."""
    while (sample := arrived.get(timeout=10)).payload == earlier:
        pass
    return sample


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


def test_a_burst_of_estimates_arrives_whole(buses):
    _, sender, receiver = buses
    arrived = listen(receiver, "sheet/state")
    publisher = sender.publisher("sheet/state", "absmsg.v1.DeformationState", STATE)
    publish_until_received(publisher, arrived, b"first")
    for burst in range(500):
        sent = [b"%d/%d" % (burst, number) + bytes(20_000) for number in range(12)]
        for payload in sent:
            publisher.put(payload)
        assert [next_after(arrived, b"first").payload for _ in sent] == sent


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


@pytest.mark.realtime
def test_a_stopped_subscriber_does_not_block_the_publisher(buses, endpoint):
    _, sender, receiver = buses
    program = f"""
import time
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
with ZenohBus.open("demo", "{endpoint}", SessionMode.CLIENT) as bus:
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
    with ZenohBus.open("demo", endpoint, SessionMode.ROUTER):
        while publish_until_received(publisher, arrived, b"after").payload != b"after":
            pass
        while not (answers := receiver.query("config", 1)):
            pass
        assert answers[0].payload == b"answer"
