"""A tracker that publishes nothing is noticed; one that is slow is not."""

import math

import pytest

from abs_service.tracking.monitors.silence_monitor import FIRST_NS, PAUSE_NS, PERIODS, SILENCE_NS, SilenceMonitor

MS = 1_000_000


class Tracker:
    """A tracker that is looked at every tenth of a second."""

    def __init__(self, **given):
        self.now_ns = 0
        self.monitor = SilenceMonitor(lambda: self.now_ns, **given)

    def silent(self, ns):
        """The monitor's message after so much time [ns]."""
        said = ""
        for _ in range(ns // (100 * MS)):
            self.now_ns += 100 * MS
            said = self.monitor.check()
        return said

    def estimate(self, period_ns, number=20):
        for _ in range(number):
            self.now_ns += period_ns
            self.monitor.add()
            assert self.monitor.check() == ""


@pytest.mark.parametrize(("period_ns", "limit_ns"), [(33 * MS, SILENCE_NS), (500 * MS, PERIODS * 500 * MS)])
def test_silence_is_so_many_periods_and_a_second_at_least(period_ns, limit_ns):
    tracker = Tracker()
    tracker.estimate(period_ns)
    assert tracker.silent(limit_ns) == ""
    assert tracker.silent(100 * MS).startswith("no estimate for ")
    tracker.estimate(period_ns, 1)


def test_the_first_estimate_may_take_longer():
    assert Tracker().silent(FIRST_NS) == ""
    assert Tracker().silent(FIRST_NS + 100 * MS) == "no estimate for 10 s"
    assert Tracker(first_ns=math.inf).silent(10 * FIRST_NS) == ""


def test_a_stop_of_the_listener_is_no_silence():
    tracker = Tracker()
    tracker.estimate(33 * MS)
    tracker.now_ns += 5 * PAUSE_NS
    assert tracker.monitor.check() == ""
    assert tracker.silent(2 * SILENCE_NS) == "no estimate for 2 s"
