"""The first estimate with status TRACKING is noticed, whoever makes it."""

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState

from abs_service.bus import keys
from abs_service.bus.contract import STATE
from abs_service.recording.triggers.first_tracking import FirstTracking
from tests.abs_service.bus.loopback import LoopbackBus


@pytest.mark.parametrize("tracker", ["left", "right"])
def test_the_first_tracking_of_any_tracker_counts(tracker):
    bus = LoopbackBus()
    tracking = FirstTracking(bus, ["left", "right"])
    publisher = bus.publisher(keys.state(tracker), DeformationState.DESCRIPTOR.full_name, STATE)
    others = [name for name in DeformationState.Status.keys() if name != "STATUS_TRACKING"]  # noqa: SIM118
    for payload in (b"\xff", *(DeformationState(status=status).SerializeToString() for status in others)):
        publisher.put(payload)
        assert not tracking.seen.is_set()
    publisher.put(DeformationState(status=DeformationState.STATUS_TRACKING).SerializeToString())
    assert tracking.seen.is_set()


def test_a_rig_without_trackers_has_nothing_to_wait_for():
    assert FirstTracking(LoopbackBus(), []).seen.is_set()
