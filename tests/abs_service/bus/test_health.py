import numpy as np
import pytest
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus.health import PERIOD_NS, Health, Level
from abs_service.bus.stamps import HeaderFactory, WallClock
from drivers.encoding.message_check import parse_valid
from tests.abs_service.bus.loopback import LoopbackBus, health_now


class Rig:
    """A component whose time is in the test's hand."""

    def __init__(self):
        self.now_ns = 0
        self.bus = LoopbackBus()
        self.health = Health(
            self.bus, "capture", HeaderFactory("demo", WallClock(lambda: self.now_ns, lambda: self.now_ns))
        )

    @property
    def said(self):
        return [Message.FromString(sample.payload) for sample in self.bus.sent]


def test_it_speaks_once_a_second():
    rig = Rig()
    for _ in range(30):
        rig.health.tick()
        rig.now_ns += PERIOD_NS // 10
    assert [message.header.seq for message in rig.said] == [0, 1, 2]
    assert {sample.topic for sample in rig.bus.sent} == {"health/capture"}


def test_a_change_of_level_is_published_at_once_and_only_once():
    rig = Rig()
    for _ in range(3):
        rig.health.report("device sim", Level.ERROR, "sim is unplugged; plug it in")
    for percent in range(3):
        rig.health.report("tracking", Level.OK, f"{percent} % agree")
    rig.health.report("disk", Level.WARNING, "nearly full")
    rig.health.report("device sim", Level.OK)
    assert [(m.level, m.message) for m in rig.said] == [
        (Message.LEVEL_ERROR, "sim is unplugged; plug it in"),
        (Message.LEVEL_ERROR, "sim is unplugged; plug it in"),
        (Message.LEVEL_WARNING, "nearly full"),
    ]


def test_a_component_without_conditions_is_ok():
    rig = Rig()
    rig.health.report("device sim", Level.OK)
    rig.health.tick()
    assert [message.level for message in rig.said] == [Message.LEVEL_OK]


def test_numbers_and_names_are_published():
    rig = Rig()
    rig.health.count("restarts")
    rig.health.count("restarts", 2)
    rig.health.count_up_to({"a": 5}, "dropped.")
    rig.health.count_up_to({"a": 3}, "dropped.")
    rig.health.gauge("queue_bytes", 1.5)
    rig.health.label("file", "x.mcap")
    rig.health.rate("rate_hz", 10)
    rig.now_ns += 2 * PERIOD_NS
    rig.health.rate("rate_hz", 70)
    rig.health.publish()
    (message,) = rig.said
    assert message.counters == {"restarts": 3, "dropped.a": 5}
    assert message.gauges == {"queue_bytes": 1.5, "rate_hz": 30.0}
    assert message.labels == {"file": "x.mcap"}
    assert (message.component, message.header.rig) == ("capture", "demo")


def test_a_number_that_no_message_holds_does_not_end_the_health_of_whoever_counts():
    rig = Rig()
    rig.health.count_up_to({"huge": 2**70, "negative": -1})
    rig.health.publish()
    assert rig.said[0].counters == {"huge": 2**64 - 1, "negative": 0}


@pytest.mark.parametrize("number", [1.5, np.float32(1.5), np.int64(1)])
def test_what_a_driver_counts_in_its_own_way_does_not_end_the_health_of_its_process(number):
    bus = LoopbackBus()
    health = Health(bus, "capture", HeaderFactory("demo", WallClock()))
    health.count_up_to({"\x1b[2J": number}, "device.x.")
    health.gauge("\x07_c", number)
    said = parse_valid(Message, health_now(health, bus).SerializeToString())
    assert (dict(said.counters), dict(said.gauges)) == ({"device.x.\\x1b[2J": 1}, {"\\x07_c": number})
