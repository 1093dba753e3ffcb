"""A rig that a display shows."""

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.supervision.health.rig_state import RigState
from tests.abs_service.display.full_swing import Clock, S, capture, recorder, report, take_health


@pytest.fixture
def live():
    """A rig in full swing: two seconds of health, one estimate."""
    clock = Clock()
    live = RigState(["sheet"], clock)
    for second in range(2):
        clock.now_ns += S
        take_health(live, capture(30 * second))
        take_health(live, recorder(second * 2_000_000))
        take_health(live, Health(component="track/sheet", level=Health.LEVEL_OK, labels={"phase": "tracking"}))
    tracker = live.trackers["sheet"]
    tracker.last, tracker.estimates, tracker.skipped = report(), 12, 3
    tracker.statuses["TRACKING"] = 12
    tracker.exposure_ns = {"tof": clock.now_ns - 50_000_000}
    for total, value in ((tracker.error_mm, 2.345), (tracker.surface_mm, 0.987), (tracker.solve_ms, 17.3)):
        total.add(value)
    return live
