"""Recording by trigger: what begins and ends it, and what of the time before is kept."""

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import MeshTopology
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.recording.triggers.trigger import ALWAYS, RequestTrigger
from abs_service.wire import commands
from tests.abs_service.recording.recorder_rig import Rig, depth, metadata, read, recordings, sequences
from tests.waiting import eventually

#: Bytes for many images.
MANY = 1 << 20


class Clock:
    """Time that passes when a test says so [ns]."""

    def __init__(self):
        self.now_ns = 10**12

    def __call__(self):
        return self.now_ns

    def pass_s(self, seconds):
        self.now_ns += int(seconds * 1e9)


class Waiting(Rig):
    """A rig whose recorder waits for a trigger and holds 2 s."""

    def __init__(self, directory, watches_status=False, post_roll_s=3.0, pre_roll_bytes=MANY, **settings):
        self.time = Clock()
        trigger = RequestTrigger(watches_status, post_roll_s, self.time)
        super().__init__(
            directory,
            trigger=trigger,
            monotonic=self.time,
            pre_roll_s=2.0,
            pre_roll_bytes=pre_roll_bytes,
            flush_s=0.005,
            **settings,
        )
        commands.answer_record(self.bus, self.headers, self.health, self.recorder.ask)
        self.recorder.start()

    def ask(self, recording):
        return commands.record(self.bus, self.headers, recording, 1.0)

    def images(self, numbers):
        """An image each second."""
        for seq in numbers:
            self.time.pass_s(1.0)
            self.publish_image(depth(seq))

    def track(self, status, seq=0):
        state = DeformationState(header=Header(seq=seq), tracker="sheet", status=status)
        self.bus.deliver(Sample(keys.state("sheet"), state.DESCRIPTOR.full_name, state.SerializeToString()))

    @property
    def reported(self):
        self.recorder.report()
        return self.said


@pytest.fixture
def waiting(tmp_path):
    made = []

    def make(**settings):
        rig = Waiting(tmp_path, **settings)
        made.append(rig)
        return rig

    yield make
    for rig in made:
        rig.recorder.stop(5)


def test_nothing_is_written_until_it_is_asked_for_and_then_the_seconds_before_as_well(waiting, tmp_path):
    rig = waiting()
    rig.images(range(10))
    assert rig.reported.labels["trigger"] == "waits, and holds the last 2 s"
    assert not list(tmp_path.iterdir())
    assert rig.ask(True).accepted
    rig.images(range(10, 13))
    assert rig.reported.labels["trigger"] == "asked for"
    assert rig.ask(False).accepted
    rig.images(range(13, 20))
    assert eventually(lambda: recordings(tmp_path))
    assert rig.reported.labels["file"] == ""
    assert sequences(tmp_path) == [7, 8, 9, 10, 11, 12]
    said = metadata(recordings(tmp_path)[0])
    assert said["ended"] == "trigger"
    assert said["messages.tof/depth/image"] == "6"


def test_pauses_between_recordings_are_no_losses(waiting, tmp_path):
    rig = waiting()
    for begin in (0, 100):
        rig.images(range(begin, begin + 5))
        assert rig.ask(True).accepted
        rig.images(range(begin + 5, begin + 7))
        assert rig.ask(False).accepted
        assert eventually(lambda begin=begin: len(recordings(tmp_path)) == 1 + bool(begin))
    assert sequences(tmp_path) == [2, 3, 4, 5, 6, 102, 103, 104, 105, 106]
    assert not any(name.startswith("missing") for name in rig.reported.counters)


def test_what_was_announced_long_before_is_in_each_recording(waiting, tmp_path):
    rig = waiting()
    topology = MeshTopology(header=Header(seq=1), tracker="sheet", mesh_version=1)
    rig.bus.deliver(Sample(keys.topology("sheet"), topology.DESCRIPTOR.full_name, topology.SerializeToString()))
    rig.images(range(10))
    rig.ask(True)
    rig.ask(False)
    assert eventually(lambda: recordings(tmp_path))
    assert "/sheet/topology" in {m.channel.topic for m in read(recordings(tmp_path)[0])[0]}


@pytest.mark.parametrize("status", [DeformationState.STATUS_DEGRADED, DeformationState.STATUS_LOST])
def test_a_tracker_that_leaves_tracking_is_recorded_for_some_time(waiting, tmp_path, status):
    rig = waiting(watches_status=True)
    rig.track(status)  # it was not tracking before
    rig.images(range(5))
    rig.track(DeformationState.STATUS_TRACKING)
    rig.images(range(5, 10))
    assert not list(tmp_path.iterdir())
    rig.track(status)
    assert rig.reported.labels["trigger"] == f"sheet was {DeformationState.Status.Name(status)[7:]}"
    rig.images(range(10, 13))  # the last of them as late as the end
    assert eventually(lambda: recordings(tmp_path))
    assert sequences(tmp_path) == [7, 8, 9, 10, 11]


def test_without_being_told_to_a_status_begins_nothing(waiting, tmp_path):
    rig = waiting()
    rig.track(DeformationState.STATUS_TRACKING)
    rig.track(DeformationState.STATUS_LOST)
    rig.images(range(3))
    assert not list(tmp_path.iterdir())


def test_what_memory_does_not_hold_is_counted_and_said(waiting, tmp_path):
    image = sum(map(len, Rig(tmp_path).publish_image(depth(0))))
    room = 2 * image + 1000  # less than three, and health fits as well
    rig = waiting(pre_roll_bytes=room)
    for seq in range(8):
        rig.publish_image(depth(seq))  # all at once
    reported = rig.reported
    assert reported.counters["pre_roll_dropped"] == 6
    assert reported.gauges["pre_roll_bytes"] <= room
    assert (reported.level, reported.message[:25]) == (Health.LEVEL_WARNING, "record.pre_roll_bytes hol")
    rig.ask(True)
    rig.ask(False)
    assert eventually(lambda: recordings(tmp_path))
    assert sequences(tmp_path) in ([6, 7], [7])  # health takes room, too
    rig.recorder.report()  # once more, of what health has pushed out
    assert rig.reported.level == Health.LEVEL_OK


def test_a_long_pre_roll_fits_into_the_queue(waiting, tmp_path):
    rig = waiting(queue_bytes=1)
    for seq in range(100):
        rig.publish_image(depth(seq))
    rig.ask(True)
    rig.ask(False)
    assert eventually(lambda: recordings(tmp_path))
    assert sequences(tmp_path) == list(range(100))


def test_a_recorder_that_records_always_refuses_commands(tmp_path):
    assert ALWAYS.ask(True) == 'record.when = "always": it records as long as it runs'
    rig = Rig(tmp_path)
    commands.answer_record(rig.bus, rig.headers, rig.health, rig.recorder.ask)
    answer = commands.record(rig.bus, rig.headers, False, 1.0)
    assert answer is not None
    assert (answer.accepted, answer.reason[:25]) == (False, 'record.when = "always": i')
    assert rig.said.counters["commands.refused"] == 1


def test_a_recorder_that_was_killed_goes_on():
    clock = Clock()
    asked, watching = RequestTrigger(False, 3.0, clock), RequestTrigger(True, 3.0, clock)
    for trigger in (asked, watching):
        trigger.resume()
    assert (asked.reason, watching.reason) == ("asked for", "the recorder was interrupted")
    clock.pass_s(3.0)
    assert (asked.reason, watching.reason) == ("asked for", "")
