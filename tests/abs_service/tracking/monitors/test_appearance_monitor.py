"""Attempts to take the appearance in cameras that had no image at first."""

from abs_service.tracking.monitors.appearance_monitor import AppearanceMonitor

SECOND_NS = 10**9


def test_nothing_is_due_while_the_cameras_are_missing_or_if_none_is_unknown():
    assert not AppearanceMonitor(("color",), 0.2).take_attempt(("color", "other"), 0)
    assert not AppearanceMonitor((), 0.2).take_attempt((), 0)


def test_attempts_keep_their_distance_and_the_reason_of_the_last_failure_is_kept():
    monitor = AppearanceMonitor(("left", "right"), 1.0)
    assert monitor.warnings == ()
    assert monitor.take_attempt(("left",), 0)
    monitor.failed("no connected surface")
    assert not monitor.take_attempt((), SECOND_NS // 2)
    assert monitor.take_attempt((), SECOND_NS)
    assert monitor.warnings == ("not used yet: left, right (no connected surface)",)
