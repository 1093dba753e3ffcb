"""A mesh of a partly occluded object is made anew once more of the object is in view."""

from abs_service.tracker.terms.sensor_fit import RimFit, SensorFit
from abs_service.tracking.monitors.growth_monitor import GrowthMonitor

SECOND_NS = 10**9


def fits(covered: int, uncovered: int) -> tuple[SensorFit, ...]:
    rim = RimFit(visible=60, covered=covered, uncovered=uncovered)
    return (SensorFit("tof", 300, 0, 300, 300, 0.0, 1.0, rim),)


def test_it_is_due_once_after_the_object_was_seen_to_continue_for_long_enough():
    monitor = GrowthMonitor(2.0)
    due = [monitor.take_attempt(fits(10, 8), k * SECOND_NS) for k in range(6)]
    assert due == [False, False, True, False, False, False]


def test_it_starts_again_when_the_edge_is_covered_again():
    monitor = GrowthMonitor(2.0)
    seen = [8, 8, 2, 8, 8, 8, 8]
    assert [monitor.take_attempt(fits(10, n), k * SECOND_NS) for k, n in enumerate(seen)].index(True) == 5


def test_an_edge_that_was_never_covered_does_not_count():
    monitor = GrowthMonitor(0.0)
    assert not monitor.take_attempt(fits(0, 0), 0)
    assert not monitor.take_attempt(fits(3, 3), 1)
