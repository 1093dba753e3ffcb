"""Messages of a rig as ROS messages."""

import struct

import numpy as np
import pytest
from abs_client.camera import camera
from abs_client.estimates import state as client_state
from abs_client.estimates.state import Status
from abs_client.images import read
from abs_client.ros2 import cameras, cdr, diagnostics, estimates, images
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import SensorModel
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from abs_service.wire.viewer_messages import point_cloud
from tests.client.messages import TRIANGLE, mesh, state, topology
from tests.client.test_rig import SIMULATION, sample

HEADER = cdr.header(Header(), "demo/tof")
POSE = np.array([[0, -1, 0, 0.5], [1, 0, 0, 0.25], [0, 0, 1, -1], [0, 0, 0, 1.0]])


def model(**changes):
    given = {"width": 4, "height": 3, "fx": 5, "fy": 6, "cx": 1, "cy": 2, "T_rs": POSE.ravel()}
    return camera(SensorModel(sensor="tof", **given | changes))


def estimate(status=Status.TRACKING, colors=b"", covariance=b"", **fields):
    faces = topology()
    faces.colors_u8 = colors
    one = client_state.received(state(5, **fields), mesh(5, covariance=covariance), faces, 0.02)
    return client_state.State(one.message, one.mesh, one.topology, status, ("because",), 0.02)


@pytest.mark.parametrize("frame", SIMULATION.frames(40), ids=lambda frame: f"{frame.sensor}/{frame.stream}")
def test_an_image_has_metres_along_the_axis_or_the_pixels_as_measured(frame):
    image = read(sample(frame))
    shares = 0.5 if images.is_radial(image.info) else 1.0
    said = images.message(image, HEADER, shares)
    if frame.kind == "depth":
        np.testing.assert_array_equal(
            said.data.view("<f4").reshape(frame.data.shape), image.values * np.float32(shares)
        )
        assert (said.encoding, said.step) == ("32FC1", 4 * said.width)
    else:
        assert said.data.tobytes() == frame.data.tobytes()
        assert said.encoding == frame.encoding
    assert (said.height, said.width) == frame.data.shape[:2]
    assert len(cdr.serialized(said)) > said.data.size


@pytest.mark.parametrize(
    ("lens", "lens_model", "name", "coefficients"),
    [
        ([], "", "plumb_bob", [0] * 5),
        ([1, 2, 3, 4, 5], "brown_conrady", "plumb_bob", [1, 2, 3, 4, 5]),
        ([1, 2, 3, 4, 5, 6, 7, 8], "brown_conrady", "rational_polynomial", [1, 2, 3, 4, 5, 6, 7, 8]),
        ([1, 2, 3, 4], "fisheye", "equidistant", [1, 2, 3, 4]),
    ],
)
def test_a_camera_with_each_lens(lens, lens_model, name, coefficients):
    given = model(lens=lens, lens_model=lens_model)
    said = cameras.info(given, HEADER, distorted=True)
    assert (said.distortion_model, said.d.tolist()) == (name, coefficients)
    assert said.k.tolist() == [5, 0, 1, 0, 6, 2, 0, 0, 1]
    assert said.p.tolist() == [5, 0, 1, 0, 0, 6, 2, 0, 0, 0, 1, 0]
    straight = cameras.info(given, HEADER, distorted=False)  # an equidistant lens without coefficients bends
    assert (straight.distortion_model, straight.d.tolist()) == ("plumb_bob", [0] * 5)
    assert cdr.serialized(said)


def test_the_pose_of_a_sensor_is_that_of_its_frame_in_the_rigs():
    (said,) = cameras.transforms({"tof": model()}, "demo").transforms
    assert (said.header.frame_id, said.child_frame_id) == ("demo", "demo/tof")
    assert (said.transform.translation.x, said.transform.translation.y, said.transform.translation.z) == (0.5, 0.25, -1)
    half = np.sqrt(0.5)
    rotation = said.transform.rotation
    np.testing.assert_allclose([rotation.x, rotation.y, rotation.z, rotation.w], [0, 0, half, half], atol=1e-12)


@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda xyzw: np.linalg.norm(xyzw) > 0.1))
def test_a_quaternion_turns_as_its_matrix(xyzw):
    wanted = Rotation.from_quat(xyzw).as_matrix()
    said = cameras.quaternion(wanted)
    np.testing.assert_allclose(Rotation.from_quat(said).as_matrix(), wanted, atol=1e-9)
    assert said[3] >= 0
    assert np.linalg.norm(said) == pytest.approx(1)


def test_a_mesh_is_a_list_of_triangles():
    said = estimates.marker(estimate(), "demo", "sheet")
    assert [(one.x, one.y, one.z) for one in said.points] == [tuple(corner) for corner in TRIANGLE.tolist()]
    assert (said.type, said.action, said.ns, said.header.frame_id) == (11, 0, "sheet", "demo")
    assert (said.scale.x, said.pose.orientation.w, said.color.a, said.colors) == (1, 1, 1, [])
    assert cdr.serialized(said)


def test_a_mesh_has_its_own_colours_only_while_it_is_tracked():
    colors = bytes([255, 0, 0, 0, 255, 0, 0, 0, 255])
    tracked = estimates.marker(estimate(colors=colors), "demo", "sheet")
    assert [(one.r, one.g, one.b, one.a) for one in tracked.colors] == [(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)]
    lost = estimates.marker(estimate(Status.LOST, colors=colors), "demo", "sheet")
    assert (lost.colors, lost.color.r) == ([], estimates.COLORS[Status.LOST][0])


def test_no_mesh_deletes_the_last_one():
    nothing = client_state.State(state(1), DeformedMesh(), MeshTopology(), Status.INITIALIZING, (), 0.0)
    said = estimates.marker(nothing, "demo", "sheet")
    assert (said.action, said.points) == (2, [])
    assert cdr.serialized(estimates.vertices(nothing, "demo"))


def test_vertices_have_their_deviation():
    covariance = np.tile(np.array([1, 0, 0, 4, 0, 4], "<f4"), 3).tobytes()
    said = estimates.vertices(estimate(covariance=covariance), "demo")
    rows = said.data.view("<f4").reshape(-1, 4)
    np.testing.assert_array_equal(rows[:, :3], TRIANGLE)
    np.testing.assert_array_equal(rows[:, 3], 3)
    assert [(one.name, one.offset, one.datatype) for one in said.fields][3] == ("sigma", 12, 7)
    assert (said.width, said.point_step, said.row_step) == (3, 16, 48)


def test_theta_with_its_deviation():
    one = estimate(theta=[1.0, 2.0], model_id="m", covariance_valid=True)
    one.message.covariance.extend([9.0, 0.5, 16.0])
    said = estimates.theta(one)
    assert said.data.tolist() == [1, 2, 3, 4]
    assert [(one.label, one.size, one.stride) for one in said.layout.dim] == [
        ("theta, deviation; seq=5", 2, 4),
        ("m", 2, 2),
    ]


def test_theta_in_bytes():
    """CDR, little-endian: numbers are aligned to their size, counted from behind the first four bytes."""
    one = estimate(theta=[1.0, 2.0], model_id="m", covariance_valid=True)
    one.message.covariance.extend([9.0, 0.5, 16.0])
    rows, columns = (2, 24, b"theta, deviation; seq=5\0", 2, 4), (2, b"m\0", 2, 2)
    wanted = struct.pack("<II24sIII2s2xIIII4d", *rows, *columns, 0, 4, 1.0, 2.0, 3.0, 4.0)
    assert cdr.serialized(estimates.theta(one)) == bytes([0, 1, 0, 0]) + wanted


def test_poses_in_bytes():
    """The layout in which the tests of foxglove/cdr have an example of this message."""
    said = cdr.serialized(cameras.transforms({"tof": model()}, "demo"))
    assert said[:44] == bytes([0, 1, 0, 0]) + struct.pack("<IiII5s3xI9s3x", 1, 0, 0, 5, b"demo\0", 9, b"demo/tof\0")
    half = np.sqrt(0.5)
    np.testing.assert_allclose(struct.unpack("<7d", said[44:]), [0.5, 0.25, -1, 0, 0, half, half], atol=1e-12)


@pytest.mark.parametrize(
    ("status", "level"),
    [
        (Status.TRACKING, 0),
        (Status.DEGRADED, 1),
        (Status.INITIALIZING, 1),
        (Status.LOST, 2),
        (Status.STALE, 3),
    ],
)
def test_the_status_of_an_estimate(status, level):
    (said,) = estimates.status(estimate(status, inlier_share=0.75), "demo", "sheet").status
    assert (said.level, said.name, said.message) == (level, "demo/sheet", f"{status}; because")
    assert {"seq": "5", "mesh_version": "1", "inlier_share": "0.75"}.items() <= {
        one.key: one.value for one in said.values
    }.items()


def test_health():
    sent = Health(component="capture", level=Health.LEVEL_WARNING, message="slow", counters={"drops": 3})
    array = diagnostics.health(sent, "demo")
    (said,) = array.status
    assert (said.level, said.name, said.message, said.hardware_id) == (1, "demo/capture", "slow", "demo")
    assert [(one.key, one.value) for one in said.values] == [("drops", "3")]
    assert cdr.serialized(array)


def test_points_of_a_depth_image():
    points = np.array([[0, 0, 1], [0.5, 0, 2], [0, 0, np.nan]], np.float32)
    said = images.points(point_cloud("tof", 1_700_000_000_000_000_001, points), "demo/tof")
    np.testing.assert_array_equal(said.data.view("<f4").reshape(-1, 3), points[:2])
    assert (said.header.stamp.sec, said.header.stamp.nanosec, said.header.frame_id) == (1_700_000_000, 1, "demo/tof")
    assert [(one.name, one.offset, one.datatype) for one in said.fields] == [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]
    assert (said.width, said.point_step) == (2, 12)
