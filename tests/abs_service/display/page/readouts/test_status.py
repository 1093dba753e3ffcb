"""All that the page says of a rig: every tracker, slow ones, and components with a warning, once each."""

import math

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import EVENTS
from abs_service.display.page.feed import Feed
from abs_service.display.page.readouts import status
from tests.abs_service.bus.loopback import LoopbackBus


class Rig:
    """Publishes what a test says, at the time that it says."""

    def __init__(self):
        self.bus, self.now_ns = LoopbackBus(), 0
        self.feed = Feed(self.bus, lambda: self.now_ns)

    def send(self, topic, message):
        self.bus.publisher(topic, message.DESCRIPTOR.full_name, EVENTS).put(message.SerializeToString())

    def state(self, tracker, name, skipped=0):
        status = f"STATUS_{name}"
        self.send(
            f"{tracker}/state", DeformationState(tracker=tracker, status=status, deviation_m=math.nan, skipped=skipped)
        )

    def health(self, component, message, level=Health.LEVEL_WARNING, **more):
        self.send(f"health/{component}", Health(component=component, message=message, level=level, **more))

    def titles(self, tracker="left"):
        return [line.title for line in status.lines(self.feed, tracker, "Start it.")]


@pytest.fixture
def rig():
    return Rig()


def test_a_rig_that_says_nothing(rig):
    (line,) = status.lines(rig.feed, "left", "Start it.")
    assert (line.title, line.text) == ("Nothing received from the rig yet", "Start it.")


def test_the_name_of_a_tracker_is_told_where_there_are_several_the_shown_one_first(rig):
    rig.state("left", "TRACKING")
    assert rig.titles() == ["Tracking"]
    rig.state("right", "LOST")
    assert rig.titles() == ["left: Tracking", "right: Object lost"]
    assert rig.titles("right") == ["right: Object lost", "left: Tracking"]


def test_what_a_status_says_is_not_said_again_as_health(rig):
    rig.state("left", "TRACKING")
    rig.state("right", "DEGRADED")
    rig.health("track/right", "DEGRADED: too few vertices")
    assert rig.titles() == ["left: Tracking", "right: Tracking with doubts"]
    rig.health("track/right", "color errs 1.4 times as much")
    rig.health("capture", "tof is silent", Health.LEVEL_ERROR)
    rig.health("record", "all is well", Health.LEVEL_OK)
    assert rig.titles()[2:] == ["capture", "track/right"]
    rig.now_ns = 4_000_000_000
    rig.state("left", "TRACKING")
    assert rig.titles()[0] == "left: Tracking"
    assert "No estimate for 4.0 s" in rig.titles()[1]
    assert len(rig.titles()) == 2


def test_health_does_not_contradict_a_newer_estimate(rig):
    rig.state("left", "TRACKING")
    rig.health("track/left", "LOST: hardly any vertex agrees")
    rig.health("run", "track/left running: no health for 2 s")
    assert rig.titles() == ["Tracking"]
    rig.health("run", "track/left running: no health for 2 s; capture running: no health for 3 s")
    assert [(line.title, line.text) for line in status.lines(rig.feed, "left", "")[1:]] == [
        ("run", "capture running: no health for 3 s")
    ]
    rig.now_ns = 2_000_000_000
    rig.health("run", "track/left backoff: killed by signal 9", Health.LEVEL_ERROR)
    assert rig.titles() == ["No estimate for 2.0 s", "run"]


def test_doubts_of_an_estimate_are_told_once(rig):
    doubts = ["it fills the image", "it is small"]
    rig.send("left/state", DeformationState(tracker="left", status="STATUS_TRACKING", warnings=doubts))
    rig.health("track/left", "; ".join(doubts))
    assert len(rig.titles()) == 1


def test_progress_of_the_compilation_is_told_for_each_tracker_that_compiles(rig):
    labels = {"phase": "preparing", "kernels": "6 of 63, about 364 s"}
    rig.health("track/left", "", Health.LEVEL_OK, labels=labels)
    (line,) = status.lines(rig.feed, "–", "Start it.")
    assert line.title == "Compiling kernels for this rig"
    assert line.text.startswith("6 of 63, about 364 s. ")
    rig.state("right", "TRACKING")
    assert rig.titles("right") == ["right: Tracking", "left: Compiling kernels for this rig"]
    rig.health("track/left", "", Health.LEVEL_OK, labels={"phase": "preparing"})
    assert rig.titles("right")[1] == "left: Loading kernels"
    rig.health("track/left", "", Health.LEVEL_OK, labels={"phase": "waiting"})
    assert rig.titles("right") == ["Tracking"]


def test_a_slow_tracker_is_told_while_it_has_estimates(rig):
    rig.send("tof/depth/image", DeformationState())  # no image, but its stream is there
    rig.feed.watch(True)
    rig.send("tof/depth/image", DeformationState())
    rig.health("capture", "", Health.LEVEL_OK, gauges={"rate_hz.tof/depth/image": 30.0})
    rig.state("left", "TRACKING")
    assert rig.titles() == ["Tracking"]
    rig.now_ns = 500_000_000
    rig.state("left", "TRACKING", skipped=2)
    assert [line.text for line in status.lines(rig.feed, "left", "Start it.")] == [""], "too early to tell"
    rig.now_ns = 1_500_000_000
    rig.state("left", "TRACKING", skipped=2)
    (line,) = status.lines(rig.feed, "left", "Start it.")
    assert line.title == "Tracking"
    assert line.text.startswith("Only 1 estimates a second of 30 images")
    rig.now_ns = 3_500_000_000
    assert rig.titles() == ["No estimate for 2.0 s"]
