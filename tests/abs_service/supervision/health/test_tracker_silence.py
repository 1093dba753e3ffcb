"""Trackers of a rig that no longer publish."""

from abs_service.bus import keys
from abs_service.bus.health import Health, Level
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.supervision.health.tracker_silence import TrackerSilence
from tests.abs_service.bus.loopback import LoopbackBus

S = 10**9


class Rig:
    """Silence of two trackers, by a clock of its own."""

    def __init__(self):
        self.now_ns = 0
        self.silence = TrackerSilence(["sheet", "strip"], lambda: self.now_ns)
        self.health = Health(LoopbackBus(), "run", HeaderFactory("bench", WallClock()))

    def run(self, seconds, *topics):
        for _ in range(seconds):
            self.now_ns += S
            for topic in topics:
                self.silence.received(topic)
            self.silence.report(self.health)


def test_each_tracker_is_watched_by_itself_from_its_first_estimate_on():
    rig = Rig()
    rig.run(3, keys.state("sheet"), "strip/mesh")  # the second is no estimate
    rig.run(16)
    assert rig.silence.found == {"sheet": "no estimate for 16 s"}
    assert rig.health.level == Level.ERROR
    rig.silence.restart("sheet")
    rig.run(1)
    assert (rig.silence.found, rig.health.level) == ({}, Level.OK)


def test_another_configuration_keeps_what_is_known_of_the_trackers_that_remain():
    rig = Rig()
    rig.run(3, keys.state("sheet"), keys.state("strip"))
    assert rig.silence.follow(["sheet", "cover"]) == ["strip"]
    rig.silence.restart("strip")  # is watched no longer
    rig.run(16)
    assert rig.silence.found == {"sheet": "no estimate for 16 s"}
