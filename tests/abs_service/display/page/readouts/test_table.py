"""Numbers of a tracker and its sensors in a table."""

import math

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import EVENTS
from abs_service.display.page.feed import Feed
from abs_service.display.page.readouts import table
from tests.abs_service.bus.loopback import LoopbackBus

MS = 1_000_000


class Bench:
    """A rig with a tracker of two sensors, 100 ms after its last estimate."""

    def __init__(self, age_ms=40.0):
        self.bus, self.now_ns = LoopbackBus(), 1000 * MS
        self.feed = Feed(self.bus, lambda: self.now_ns)
        state = DeformationState(tracker="sheet", age_ms=age_ms, generations=3)
        state.header.t_host_ns = 900 * MS
        state.sensors.add(sensor="tof", t_host_ns=900 * MS, samples=9, mean_log_likelihood=-1.5)
        state.sensors.add(sensor="cam", t_host_ns=890 * MS)
        state.sensors.add(sensor="late", missing=True)
        self.send("sheet/state", state)
        self.now_ns += 100 * MS

    def send(self, topic, message):
        self.bus.publisher(topic, message.DESCRIPTOR.full_name, EVENTS).put(message.SerializeToString())

    def rows(self):
        return table.rows(self.feed, "sheet")


def test_every_sensor_says_how_old_it_is_by_now():
    rows = Bench().rows()
    assert rows["tof"] == "0.1 s old, log-likelihood -1.50, no losses"
    assert rows["cam"] == "0.2 s old, no losses"
    assert rows["late"] == "no frame in time, no losses"
    assert Bench(math.nan).rows()["tof"].startswith("log-likelihood")


def test_losses_are_told_by_sensor_and_cause_where_they_concern_the_tracker():
    bench = Bench()
    counters = {"lost.tof/depth/image": 2, "unused.tof/ir.old_epoch": 3, "unused.cam/color.stale": 1, "skipped": 4}
    bench.send("health/track/sheet", Health(component="track/sheet", counters=counters))
    bench.send("health/capture", Health(component="capture", counters={"dropped.tof/depth/image": 5, "frames": 7}))
    bench.send("health/record", Health(component="record", counters={"dropped.tof/depth/image": 6}))
    rows = bench.rows()
    assert rows["tof"].endswith("5 dropped, 2 lost, 3 unused")
    assert rows["cam"].endswith("1 unused")
    assert rows["lost"] == "5 capture, 6 record, 10 track/sheet"


def test_the_recorder_says_what_it_does():
    bench = Bench()
    labels = {"file": "demo_1.mcap.active", "trigger": "asked for"}
    bench.send("health/record", Health(component="record", labels=labels))
    assert (bench.rows()["recording"], bench.rows()["recorder"]) == ("demo_1.mcap", "asked for")


def test_before_the_first_estimate_there_are_no_sensors():
    assert table.rows(Feed(LoopbackBus(), lambda: 0), "sheet") == {"estimates": "0.0 Hz, 0 skipped", "lost": "nothing"}
