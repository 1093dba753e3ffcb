"""Drops are told as long as they last, and counted for ever; what never came is counted, too, or asked for."""

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.recording.losses import CALM_REPORTS, Losses
from abs_service.wire import message_header
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.recording.recorder_rig import DEPTH, Rig, depth, read, recordings
from tests.waiting import eventually


def test_a_disk_that_was_too_slow_once_is_well_again():
    bus = LoopbackBus()
    health = Health(bus, "record", HeaderFactory("demo", WallClock()))
    losses = Losses(health, lambda: 0)

    def said(dropped, failed=False):
        losses.report({"tof/depth": dropped}, failed)
        return health_now(health, bus)

    assert said(0).level == Message.LEVEL_OK
    assert said(20, failed=True).level == Message.LEVEL_OK, "RECORD_FAILED says it"
    for _ in range(CALM_REPORTS):
        assert said(25).message == "the disk is too slow: 5 messages dropped"
    calm = said(25)
    assert (calm.level, calm.counters["dropped.tof/depth"]) == (Message.LEVEL_OK, 25)
    assert said(26).message == "the disk is too slow: 6 messages dropped"


def test_estimates_that_never_came_are_said_as_images_are(tmp_path):
    """Health said OK while a busy bus dropped estimates, and `run` had 0 dropped."""
    rig = Rig(tmp_path)
    rig.recorder.start()
    for seq in (0, 1, 4):
        for topic, kind in ((keys.state("sheet"), DeformationState), (keys.mesh("sheet"), DeformedMesh)):
            rig.bus.deliver(message(topic, kind(header=rig.headers.now(seq), tracker="sheet")))
    rig.recorder.report()
    rig.recorder.stop(5)
    assert rig.said.message == "4 messages were lost on their way to the recorder"
    assert rig.said.counters[f"lost.{keys.state('sheet')}"] == rig.said.counters[f"lost.{keys.mesh('sheet')}"] == 2


def test_the_last_images_of_a_camera_that_never_came_are_counted_when_the_recorder_ends(tmp_path):
    """Nothing followed them that would show the gap: `run` had 0 dropped."""
    rig = Rig(tmp_path)
    rig.recorder.start()
    rig.publish_image(depth(0))
    capture = Message(header=rig.headers.now(0), component="capture", counters={f"published.{DEPTH}": 4})
    rig.bus.deliver(message("health/capture", capture))
    rig.recorder.stop(5)
    rig.recorder.report()
    assert rig.said.message == "3 messages were lost on their way to the recorder"


def test_a_topology_that_did_not_come_is_asked_for_and_recorded_once(tmp_path):
    """The tracker stood still when the recorder asked at its start, or the bus dropped what is sent once."""
    rig = Rig(tmp_path)
    rig.recorder.start()
    hour_ago = rig.headers.at(rig.clock.monotonic() - 3600 * 10**9, 7)
    topology = MeshTopology(header=hour_ago, tracker="sheet", mesh_version=7)
    asked = []
    rig.bus.answer_queries(
        keys.topology("sheet"),
        message_header.TOPOLOGY,
        lambda: asked.append(topology) or topology.SerializeToString(),
    )
    for seq in range(4):
        mesh = DeformedMesh(header=rig.headers.now(seq), tracker="sheet", mesh_version=7)
        rig.bus.deliver(message(keys.mesh("sheet"), mesh))
        assert eventually(lambda count=seq + 1: rig.written(count))
        rig.recorder.report()
    rig.recorder.stop(5)
    messages = read(recordings(tmp_path)[0])[0]
    (found,) = [m.message for m in messages if m.channel.topic == "/sheet/topology"]
    assert (found.data, len(asked)) == (topology.SerializeToString(), 1)
    times = [m.message.log_time for m in messages]
    assert max(times) - min(times) < 60 * 10**9, "a file does not begin when the mesh was made"


def message(topic, content):
    return Sample(topic, content.DESCRIPTOR.full_name, content.SerializeToString())
