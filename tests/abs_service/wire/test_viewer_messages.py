"""Meshes and points for viewers hold the numbers of the messages that they are made from."""

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from google.protobuf.timestamp_pb2 import Timestamp

from abs_service.bus.contract import Sample
from abs_service.wire import message_header
from abs_service.wire.estimate_messages import State
from abs_service.wire.viewer_messages import COLORS, ViewRate, point_cloud, scene_update

STAMP = Timestamp(seconds=1_700_000_000, nanos=5)
VERTICES = np.random.default_rng(2).normal(size=(5, 3)).astype("<f4")
FACES = np.array([[0, 1, 2], [2, 3, 4]], "<u4")
RGB = np.arange(15, dtype="u1").reshape(5, 3)
MESH = DeformedMesh(header=Header(stamp=STAMP), tracker="sheet", mesh_version=1, vertices_f32=VERTICES.tobytes())
TOPOLOGY = MeshTopology(tracker="sheet", mesh_version=1, faces_u32=FACES.tobytes(), colors_u8=RGB.tobytes())


def triangles(status, topology=TOPOLOGY):
    (entity,) = scene_update(MESH, topology, status).entities
    assert (entity.id, entity.frame_id, entity.timestamp) == ("sheet", "rig", STAMP)
    return entity.triangles[0]


def test_a_scene_has_the_vertices_and_faces_of_its_mesh():
    found = triangles(State.STATUS_TRACKING)
    np.testing.assert_array_equal([(one.x, one.y, one.z) for one in found.points], VERTICES)
    np.testing.assert_array_equal(np.reshape(found.indices, (-1, 3)), FACES)
    np.testing.assert_allclose([(one.r, one.g, one.b) for one in found.colors], RGB / 255.0)
    assert found.pose.orientation.w == 1


def test_the_colour_tells_the_status_unless_a_tracked_object_has_its_own():
    for status in (State.STATUS_DEGRADED, State.STATUS_LOST):
        found = triangles(status)
        assert not found.colors
        assert (found.color.r, found.color.g, found.color.b) == COLORS[status]
    assert not triangles(State.STATUS_TRACKING, MeshTopology(faces_u32=FACES.tobytes())).colors


def test_without_a_mesh_the_last_one_is_deleted():
    empty = DeformedMesh(header=Header(stamp=STAMP), tracker="sheet")
    (deletion,) = scene_update(empty, TOPOLOGY, State.STATUS_INITIALIZING).deletions
    assert deletion.id == "sheet"


def test_a_cloud_has_the_points_that_are_known():
    points = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    points[0, 1] = np.nan
    cloud = point_cloud("tof", 10**18, points)
    assert (cloud.frame_id, cloud.timestamp.ToNanoseconds()) == ("tof", 10**18)
    assert [(one.name, one.offset) for one in cloud.fields] == [("x", 0), ("y", 4), ("z", 8)]
    read = np.frombuffer(cloud.data, "<f4").reshape(-1, cloud.point_stride // 4)
    np.testing.assert_array_equal(read, points.reshape(-1, 3)[[0, 2, 3]])


@pytest.mark.parametrize(("hz", "expected"), [(0, 0), (10, 10), (7, 7), (30, 30), (100, 30)])
def test_no_more_than_the_rate_is_due(hz, expected):
    rate = ViewRate(hz)
    times = [round((k + 0.5) / 30 * 1e9) + 60 * 10**9 for k in range(30)]
    assert sum(map(rate.due, times)) == expected


def test_the_recorder_reads_their_stamps():
    scene = scene_update(MESH, TOPOLOGY, State.STATUS_TRACKING)
    deletion = scene_update(DeformedMesh(header=Header(stamp=STAMP)), TOPOLOGY, State.STATUS_LOST)
    cloud = point_cloud("tof", STAMP.ToNanoseconds(), np.zeros((1, 3), np.float32))
    for message in (scene, deletion, cloud):
        sample = Sample("x", message.DESCRIPTOR.full_name, message.SerializeToString())
        assert message_header.parse(sample).stamp_ns == STAMP.ToNanoseconds()
