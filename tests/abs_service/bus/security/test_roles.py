"""Access rights by the name of a certificate, on real sessions with mutual TLS."""

import logging
import time

import pytest
import zenoh
from absmsg.v1.deformation_state_pb2 import DeformationState
from zenoh import ext

from abs_service.bus import keys as topics
from abs_service.bus.contract import EVENTS, STATE
from abs_service.bus.health import Health
from abs_service.bus.security import roles
from abs_service.bus.session import SessionMode, open_session
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.wire import commands, control_commands
from tests.abs_service.bus.loopback import LoopbackBus
from tests.conftest import encrypted, mutual_tls
from tests.waiting import eventually

CLIENTS = sorted(roles.PUBLISHES)
#: A topic of each kind, and who may publish there; the host that listens may everywhere.
PUBLISHERS = {
    "tof/depth/image": "capture",
    "tof/depth/points": "capture",
    "tof/calibration": "capture",
    "tof/model": "capture",
    "tf": "capture",
    "config": "capture",
    "schema": "capture",
    "clock/0b6c": "capture",
    "sim/truth": "capture",
    "sim/controls": "capture",
    "health/capture": "capture",
    "sheet/state": "tracker",
    "sheet/mesh": "tracker",
    "sheet/scene": "tracker",
    "sheet/theta": "tracker",
    "sheet/topology": "tracker",
    "sheet/reinitialize": "tracker",
    "health/track/sheet": "tracker",
    "record": "recorder",
    "health/record": "recorder",
    "health/run": "rig",
    "anything": "rig",
}


@pytest.fixture
def rig(secured):
    return secured("rig", SessionMode.ROUTER)


def received(bus, pattern="**"):
    arrived = []
    bus.subscribe(pattern, arrived.append)
    return arrived


@pytest.mark.parametrize("name", CLIENTS)
def test_each_name_publishes_on_its_own_topics_and_on_no_other(name, rig, secured):
    arrived, client = received(rig), secured(name)
    everybody = secured("rig")
    for topic in PUBLISHERS:
        client.publisher(topic, "m", EVENTS).put(b"")
    expected = sorted(topic for topic, publisher in PUBLISHERS.items() if publisher == name)
    assert eventually(lambda: len(arrived) >= len(expected))
    # Those of the rig come later than anything that was let through.
    for topic in PUBLISHERS:
        everybody.publisher(topic, "end", EVENTS).put(b"")
    assert eventually(lambda: sum(sample.message == "end" for sample in arrived) == len(PUBLISHERS))
    assert sorted(sample.topic for sample in arrived if sample.message == "m") == expected


@pytest.mark.parametrize("name", CLIENTS)
def test_each_name_answers_queries_for_its_own_topics_only(name, rig, secured):
    client = secured(name)
    for topic in PUBLISHERS:
        client.answer_queries(topic, "m", lambda: b"")
    expected = sorted(topic for topic, publisher in PUBLISHERS.items() if publisher == name)

    def answered():
        return sorted(sample.topic for sample in rig.query("**", 1.0))

    assert eventually(lambda: answered() == expected)
    time.sleep(0.1)
    assert answered() == expected


@pytest.mark.parametrize("name", CLIENTS)
def test_all_but_capture_read_everything(name, rig, secured):
    sender, client = secured("rig"), secured(name)
    arrived, control = received(client), received(rig)
    publishers = [sender.publisher(topic, "m", EVENTS) for topic in PUBLISHERS]
    sender.answer_queries("config", "m", lambda: b"toml")
    assert eventually(lambda: bool(rig.query("config", 1.0)))

    def complete():
        for publisher in publishers:
            publisher.put(b"")
        return {sample.topic for sample in (arrived if name in roles.READERS else control)} == set(PUBLISHERS)

    assert eventually(complete)
    assert bool(arrived) == bool(client.query("config", 1.0)) == (name in roles.READERS)


def test_of_fifty_forged_estimates_none_arrives(rig, secured):
    true, reader, forger = secured("tracker"), secured("viewer"), secured("viewer")
    arrived = received(reader, "sheet/state")
    forged, estimates = (
        bus.publisher(topics.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE) for bus in (forger, true)
    )
    for number in range(50):
        forged.put(b"forged")
        estimates.put(b"true %d" % number)
    assert eventually(lambda: estimates.put(b"true") or (arrived and arrived[-1].payload == b"true"))
    time.sleep(0.2)
    assert {sample.payload[:4] for sample in arrived} == {b"true"}


def test_late_joiners_get_the_history_of_estimates(rig, secured, keys, endpoint):
    publisher = secured("tracker").publisher("sheet/state", "m", STATE)
    publisher.put(b"before")
    arrived = []
    session = open_session(encrypted(endpoint), SessionMode.CLIENT, security=mutual_tls(keys, "viewer"))
    subscriber = ext.declare_advanced_subscriber(
        session,
        "abs/demo/sheet/state",
        lambda sample: arrived.append(sample.payload.to_bytes()),
        history=ext.HistoryConfig(detect_late_publishers=True),
    )
    assert eventually(lambda: arrived == [b"before"])
    subscriber.undeclare()
    session.close()


def test_liveliness_tokens_are_those_of_the_names(rig, secured):
    seen = set()
    secured("viewer").watch_liveliness(lambda component, alive: (seen.add if alive else seen.discard)(component))
    for name in ("viewer", "recorder", "tracker", "capture"):
        bus = secured(name)
        for component in ("capture", "record", "run", "track/sheet"):
            bus.declare_liveliness(component)
        expected = {"viewer": set(), "recorder": {"record"}, "tracker": {"track/sheet"}, "capture": {"capture"}}[name]
        assert eventually(lambda wanted=expected: seen == wanted)
        bus.close()
        assert eventually(lambda: not seen)


@pytest.mark.parametrize("name", [*CLIENTS, "rig"])
def test_commands_are_for_operators(name, rig, secured):
    acted = []
    headers, tracker = HeaderFactory("demo", WallClock()), secured("tracker")
    health = Health(LoopbackBus(), "track/sheet", headers)

    def act(seed):
        acted.append(seed)
        return ""

    commands.answer_reinitialize(tracker, "sheet", headers, health, act)
    assert eventually(lambda: commands.reinitialize(rig, "sheet", headers, 1.0) is not None)
    acted.clear()
    client = secured(name)
    answer = commands.reinitialize(client, "sheet", headers, 1.0)
    allowed = name in ("operator", "rig")
    assert (answer is not None and answer.accepted, bool(acted)) == (allowed, allowed)
    acted.clear()
    for pattern in ("**", "*/reinitialize", "sheet/*"):
        assert client.command(pattern, commands.REINITIALIZE, _command(headers), 1.0) == []
    assert not acted


@pytest.mark.parametrize("name", [*CLIENTS, "rig"])
def test_only_operators_tell_the_recorder(name, rig, secured):
    acted = []
    headers, recorder = HeaderFactory("demo", WallClock()), secured("recorder")
    health = Health(LoopbackBus(), "record", headers)
    commands.answer_record(recorder, headers, health, lambda recording: acted.append(recording) or "")
    assert eventually(lambda: commands.record(rig, headers, False, 1.0) is not None)
    answer = commands.record(secured(name), headers, True, 1.0)
    allowed = name in ("operator", "rig")
    assert (answer is not None and answer.accepted, True in acted) == (allowed, allowed)


@pytest.mark.parametrize(("name", "allowed"), [("operator", True), ("viewer", False), ("tracker", False)])
def test_only_operators_set_controls(name, allowed, rig, secured):
    acted = []
    headers, capture = HeaderFactory("demo", WallClock()), secured("capture")
    health = Health(LoopbackBus(), "capture", headers)
    control_commands.answer_controls(capture, "sim", headers, health, lambda values: acted.append(values) or {})
    assert eventually(lambda: control_commands.set_controls(rig, "sim", headers, 1.0, {}) is not None)
    answer = control_commands.set_controls(secured(name), "sim", headers, 1.0, {"gain": 2.0})
    assert (answer is not None, {"gain": 2.0} in acted) == (allowed, allowed)


def test_who_connects_is_in_the_log_of_the_router(rig, secured, caplog):
    with caplog.at_level(logging.INFO, "abs_service.bus.security.link_log"):
        secured("operator").close()
        assert eventually(lambda: "operator disconnected: tls/" in caplog.text)
    assert "operator connected: tls/" in caplog.text


def test_every_topic_of_the_bus_has_a_publisher():
    made = {
        *(
            topics.image("a", "b"),
            topics.points(topics.image("a", "b")),
            topics.TRANSFORMS,
            topics.CONFIG,
            topics.SCHEMA,
            topics.RECORD,
        ),
        *(part("a") for part in (topics.calibration, topics.model, topics.truth, topics.clock)),
        *(part("a") for part in (topics.state, topics.mesh, topics.scene, topics.topology, topics.reinitialize)),
        *(make(part) for make in (topics.health, topics.live) for part in ("capture", "record", "track/a")),
    }
    allowed = [zenoh.KeyExpr(topic) for published in roles.PUBLISHES.values() for topic in published]
    assert [topic for topic in made if sum(key.includes(zenoh.KeyExpr(topic)) for key in allowed) != 1] == []


def _command(headers):
    return commands.Reinitialize(header=headers.now(0), tracker="sheet").SerializeToString()
