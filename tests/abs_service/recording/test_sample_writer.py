"""Times of messages in a recording, of which some have a stamp of the wall clock alone."""

import itertools
from typing import Any

import pytest
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

from abs_service.bus.contract import Sample
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.recording.sample_writer import SampleWriter
from tests.abs_service.bus.loopback import LoopbackBus

SECOND_NS = 10**9
BEGIN_NS = 1_800_000_000 * SECOND_NS


class Stamps(list):
    """A take that keeps the times alone."""

    def write(self, topic, message, payload, stamp_ns, seq):
        self.append(stamp_ns)


@pytest.mark.parametrize("step_s", [-3600, 3600, 31_557_600, -700_000_000])
def test_a_step_that_sender_and_recorder_notice_at_different_times_changes_no_order(step_s):
    ticks, steps_ns = itertools.count(SECOND_NS, 1000), [0]
    now = ticks.__next__
    sender, clock = (WallClock(now, lambda: BEGIN_NS + next(ticks) + steps_ns[0]) for _ in range(2))
    writer = SampleWriter(
        lambda image: ("", image), Health(LoopbackBus(), "record", HeaderFactory("demo", clock)), clock
    )
    take: Any = Stamps()
    points = PointCloud(frame_id="tof")
    writer.begin(take)

    def put():
        points.timestamp.FromNanoseconds(sender.wall(now()))
        writer.write(take, Sample("tof/depth/points", points.DESCRIPTOR.full_name, points.SerializeToString()))

    for first, second in ((sender, clock), (clock, sender)):
        put()
        steps_ns[0] += step_s * SECOND_NS
        first.measure()
        put()
        second.measure()
        put()
    assert take == sorted(take)
    assert BEGIN_NS < take[0] <= take[-1] < BEGIN_NS + 2 * SECOND_NS
