"""The page's copy of a rig's state, fed from the bus."""

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import EVENTS, IMAGES
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.display.page.feed import Feed
from abs_service.display.page.numbers import rate_hz
from drivers.contract.frame import Frame, Kind
from drivers.encoding import codec
from tests.abs_service.bus.loopback import LoopbackBus


class Rig:
    """Publishes what a test says, at the time that it says."""

    def __init__(self):
        self.bus, self.now_ns = LoopbackBus(), 0
        self.feed = Feed(self.bus, lambda: self.now_ns)
        self.headers = HeaderFactory("demo", WallClock(lambda: self.now_ns, lambda: self.now_ns), boot_id="a")

    def send(self, topic, message):
        self.bus.publisher(topic, message.DESCRIPTOR.full_name, EVENTS).put(message.SerializeToString())

    def image(self, t_host_ns):
        frame = Frame("tof", "ir", Kind.IR, np.zeros((2, 2), "u1"), "mono8", t_host_ns, t_host_ns, t_host_ns)
        payload = codec.encode_image(frame, 0), codec.encode_info(frame, self.headers.at(t_host_ns, 0))
        self.bus.publisher("tof/ir/image", codec.IMAGE_SCHEMA, IMAGES).put(*payload)


def test_the_newest_message_and_its_age():
    rig = Rig()
    assert rig.feed.age_s() == float("inf")
    rig.send("sheet/state", DeformationState(tracker="sheet", generations=3))
    rig.now_ns = 2_000_000_000
    found = rig.feed.newest("sheet/state", DeformationState)
    assert found is not None
    assert (found[0].generations, found[1], rig.feed.age_s()) == (3, 2.0, 2.0)
    assert rig.feed.trackers() == ["sheet"]
    assert rig.feed.newest("sheet/state", DeformedMesh) is None


def test_numbers_are_kept_for_a_minute_and_give_the_rate():
    rig = Rig()
    for second in range(90):
        rig.now_ns = second * 1_000_000_000
        rig.send("sheet/state", DeformationState(tracker="sheet", solve_ms=second))
    numbers = rig.feed.numbers("sheet")
    assert [one.solve_ms for one in numbers] == list(range(29, 90))
    assert rate_hz(numbers, rig.feed.now_s) == 1.0


def test_a_rate_is_not_taken_for_lower_in_the_first_seconds():
    rig = Rig()
    for frame in range(31):
        rig.now_ns = frame * 33_000_000
        rig.send("sheet/state", DeformationState(tracker="sheet"))
        if not frame:
            assert rate_hz(rig.feed.numbers("sheet"), rig.feed.now_s) == 0.0
    assert rate_hz(rig.feed.numbers("sheet"), rig.feed.now_s) == pytest.approx(1 / 0.033)


def test_every_estimate_has_what_each_component_had_lost_until_then():
    rig = Rig()
    for lost in (2, 5):
        rig.send("health/capture", Health(component="capture", counters={"dropped.tof/depth/image": lost, "frames": 9}))
        rig.send("sheet/state", DeformationState(tracker="sheet"))
    assert [one.lost for one in rig.feed.numbers("sheet")] == [{"capture": 2}, {"capture": 5}]


def test_images_come_only_while_somebody_looks_and_the_nearest_exposure_is_found():
    rig = Rig()
    rig.image(100)
    assert rig.feed.streams() == []
    rig.feed.watch(True)
    for t_ns in (200, 300, 400):
        rig.image(t_ns)
    found = [rig.feed.frame("tof/ir/image", t_ns) for t_ns in (0, 190, 310)]
    assert [one and one[0].t_host_ns for one in found] == [400, 200, 300]
    rig.feed.watch(False)
    rig.image(500)
    assert rig.feed.streams() == []


def test_meshes_are_received_only_while_somebody_looks():
    rig, topic = Rig(), "sheet/mesh"
    versions = []
    for version, looked_at in enumerate((False, True, False), 1):
        rig.feed.watch(looked_at)
        rig.send(topic, DeformedMesh(tracker="sheet", mesh_version=version))
        found = rig.feed.newest(topic, DeformedMesh)
        versions.append(found[0].mesh_version if found else 0)
    assert versions == [0, 2, 2]


def test_the_topology_of_another_mesh_is_not_used_and_the_right_one_asked_for():
    rig = Rig()
    mesh = DeformedMesh(header=rig.headers.now(0), tracker="sheet", mesh_version=2)
    rig.send("sheet/topology", MeshTopology(header=rig.headers.now(0), tracker="sheet", mesh_version=1))
    assert rig.feed.topology(mesh) is None
    right = MeshTopology(header=rig.headers.now(0), tracker="sheet", mesh_version=2)
    rig.bus.answer_queries("sheet/topology", right.DESCRIPTOR.full_name, right.SerializeToString)
    assert rig.feed.topology(mesh) == right


def test_malformed_messages_are_counted():
    rig = Rig()
    rig.bus.publisher("health/run", Health.DESCRIPTOR.full_name, EVENTS).put(b"\xff")
    assert rig.feed.malformed == 1
    assert rig.feed.healths() == []
