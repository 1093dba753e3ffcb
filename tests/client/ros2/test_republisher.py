"""A rig in the ROS graph: what a plain zenoh session receives there, decoded by rosbags."""

import queue
import struct
import threading
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from abs_client.connection.link import Link
from abs_client.errors import UnreachableError
from abs_client.ros2 import layout
from abs_client.ros2.node import RosNode
from abs_client.ros2.republisher import Republisher
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import SensorModel
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from rosbags.typesys import Stores, get_typestore
from zenoh import ext

from abs_service.bus import keys as topics
from abs_service.bus.contract import EVENTS, IMAGES
from drivers.encoding import codec
from drivers.simulated.address import parse
from tests.client.publishing import estimating
from tests.client.test_rig import sample
from tests.waiting import eventually, repeating

FRAME = next(one for one in parse("simulated://sheet?sensors=tof").build().frames(0) if one.stream == "depth")
HEIGHT, WIDTH = FRAME.data.shape
MODEL = SensorModel(
    sensor="tof", width=WIDTH, height=HEIGHT, fx=WIDTH, fy=WIDTH, cx=WIDTH / 2, cy=HEIGHT / 2, T_rs=np.eye(4).ravel()
)
TYPES = get_typestore(Stores.ROS2_JAZZY)
WAIT_S = 20.0


class Listener:
    """A subscription as a ROS node has one: to a topic and type of which it knows the hash."""

    def __init__(self, session, topic, message):
        self._message = message
        type_hash = TYPES.hash_rihs01(message)
        self.key = f"3/{topic}/{layout.dds_type(message)}/{type_hash}"
        self._samples = queue.SimpleQueue()
        self._subscriber = session.declare_subscriber(self.key, self._samples.put)

    def next(self) -> tuple[Any, int, int, bytes]:
        """A message, and sequence number, time and identity of its publisher."""
        one = self._samples.get(timeout=WAIT_S)
        number, time_ns, size, identity = struct.unpack("<qqB16s", one.attachment.to_bytes())
        assert size == 16
        return TYPES.deserialize_cdr(one.payload.to_bytes(), self._message), number, time_ns, identity


@pytest.fixture
def in_ros(bus, endpoint, ros_router):
    """Has the rig in the ROS graph; its node's link is open until the test ends."""
    router, _ = ros_router
    end = threading.Event()
    with ExitStack() as stack:
        bus.answer_queries(topics.model("tof"), SensorModel.DESCRIPTOR.full_name, MODEL.SerializeToString)
        bus.declare_liveliness("track/sheet")
        node = stack.enter_context(RosNode(router, "abs_demo", 3))
        republisher = Republisher(stack.enter_context(Link(endpoint, "demo")), node, 0.5)
        running = threading.Thread(target=republisher.run, args=(end,))
        running.start()
        yield republisher
        end.set()
        running.join(WAIT_S)
        assert not running.is_alive()


@contextmanager
def imaging(bus):
    publisher, one = bus.publisher(topics.image("tof", "depth"), codec.IMAGE_SCHEMA, IMAGES), sample(FRAME)
    with repeating(lambda: publisher.put(one.payload, one.attachment), 0.02):
        yield


def test_depth_images_arrive_in_metres_along_the_axis_with_their_camera(bus, in_ros, ros_router):
    _, session = ros_router
    depth = Listener(session, "demo/tof/depth/image", "sensor_msgs/msg/Image")
    info = Listener(session, "demo/tof/depth/camera_info", "sensor_msgs/msg/CameraInfo")
    with imaging(bus):
        image, *_ = depth.next()
        camera, *_ = info.next()
    radial = np.where(FRAME.data == FRAME.invalid, np.nan, np.multiply(FRAME.data, FRAME.scale))
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    wanted = radial / np.hypot(1, np.hypot((u - WIDTH / 2) / WIDTH, (v - HEIGHT / 2) / WIDTH))
    np.testing.assert_allclose(image.data.view("<f4").reshape(HEIGHT, WIDTH), wanted, rtol=1e-5)
    assert (image.header.frame_id, image.encoding) == ("demo/tof", "32FC1")
    assert (camera.header.frame_id, camera.width, camera.k[0]) == ("demo/tof", WIDTH, WIDTH)


def test_every_message_has_the_next_number_the_time_and_the_hash_of_its_publishers_token(bus, in_ros, ros_router):
    _, session = ros_router
    depth = Listener(session, "demo/tof/depth/image", "sensor_msgs/msg/Image")
    before_ns = time.time_ns()
    with imaging(bus):
        received = [depth.next()[1:] for _ in range(3)]
    numbers, times, identities = zip(*received)
    assert numbers == (1, 2, 3)
    assert before_ns < times[0] < times[1] < times[2] < time.time_ns()
    tokens = [str(one.ok.key_expr) for one in session.liveliness().get("@ros2_lv/3/**") if one.ok]
    node, topic = "/MP/%/%/abs_demo/", "%demo%tof%depth%image/"
    (own,) = [token for token in tokens if node + topic in token]
    assert set(identities) == {layout.gid(own)}
    assert own.endswith(depth.key.partition("image/")[2] + "/::,10:,:,:,,")


def test_the_node_is_in_the_graph_as_long_as_it_lives(bus, in_ros, ros_router):
    _, session = ros_router

    def nodes():
        return [str(one.ok.key_expr) for one in session.liveliness().get("@ros2_lv/3/*/0/0/NN/**") if one.ok]

    assert eventually(lambda: len(nodes()) == 1)
    assert nodes()[0].split("/")[-4:] == ["NN", "%", "%", "abs_demo"]


def test_estimates_arrive_as_mesh_vertices_theta_and_status(bus, tracker, in_ros, ros_router):
    _, session = ros_router
    mesh = Listener(session, "demo/sheet/mesh", "visualization_msgs/msg/Marker")
    vertices = Listener(session, "demo/sheet/vertices", "sensor_msgs/msg/PointCloud2")
    theta = Listener(session, "demo/sheet/theta", "std_msgs/msg/Float64MultiArray")
    status = Listener(session, "demo/sheet/status", "diagnostic_msgs/msg/DiagnosticArray")
    with estimating(tracker):
        points = vertices.next()[0]
        triangles = mesh.next()[0]
        parameters = theta.next()[0]
    np.testing.assert_array_equal(points.data.view("<f4").reshape(-1, 4)[:, :3], tracker.vertices)
    assert len(triangles.points) == 3 * (tracker.size - 2)
    assert parameters.data[0] == 0.5
    said = status.next()[0].status[0]
    while said.level != 3:  # until nothing comes any more
        assert said.message == "TRACKING"
        said = status.next()[0].status[0]
    assert said.message.startswith("STALE; the newest estimate is")


def test_poses_are_there_for_a_node_that_comes_later(bus, in_ros, ros_router):
    _, session = ros_router
    assert eventually(lambda: "/tf_static" in in_ros.published)
    samples = queue.SimpleQueue()
    key = f"3/tf_static/tf2_msgs::msg::dds_::TFMessage_/{TYPES.hash_rihs01('tf2_msgs/msg/TFMessage')}"
    late = ext.declare_advanced_subscriber(  # as rmw_zenoh makes a transient local subscription
        session, key, samples.put, history=ext.HistoryConfig(detect_late_publishers=True)
    )
    one = samples.get(timeout=WAIT_S)
    late.undeclare()
    message: Any = TYPES.deserialize_cdr(one.payload.to_bytes(), "tf2_msgs/msg/TFMessage")
    (pose,) = message.transforms
    assert (pose.header.frame_id, pose.child_frame_id, pose.transform.rotation.w) == ("demo", "demo/tof", 1)


def test_health_and_what_was_not_published_arrive_as_diagnostics(bus, in_ros, ros_router):
    _, session = ros_router
    diagnostics = Listener(session, "diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    health = bus.publisher(topics.health("capture"), Health.DESCRIPTOR.full_name, EVENTS)
    images = bus.publisher(topics.image("tof", "depth"), codec.IMAGE_SCHEMA, IMAGES)
    broken = RawImage(width=2, height=2, encoding="mono8").SerializeToString()
    sent = Health(header=Header(boot_id="a"), component="capture", level=Health.LEVEL_ERROR, message="unplugged")

    def publish():
        sent.header.seq += 2  # every second one is lost
        health.put(sent.SerializeToString())
        images.put(broken)

    found = {}
    with repeating(publish, 0.02):
        while not {"demo/capture", "demo/ros2"} <= found.keys() or not found["demo/ros2"].values:
            said = diagnostics.next()[0].status[0]
            found[said.name] = said
        assert eventually(lambda: in_ros.left_out["/demo/health/capture: lost on the way"] > 0)
    assert (found["demo/capture"].level, found["demo/capture"].message) == (2, "unplugged")
    assert in_ros.left_out["/demo/tof/depth/image: unreadable"] > 0


def test_what_does_not_fit_its_camera_or_itself_is_left_out_and_the_rest_goes_on(bus, in_ros, ros_router):
    """As for a moment when a camera has a new resolution: its images and its calibration come by different threads."""
    _, session = ros_router
    depth = Listener(session, "demo/tof/depth/image", "sensor_msgs/msg/Image")
    cloud = Listener(session, "demo/tof/depth/points", "sensor_msgs/msg/PointCloud2")
    images = bus.publisher(topics.image("tof", "depth"), codec.IMAGE_SCHEMA, IMAGES)
    points = bus.publisher(topics.points(topics.image("tof", "depth")), PointCloud.DESCRIPTOR.full_name, IMAGES)
    other = sample(replace(FRAME, data=FRAME.data[::2]))

    def publish():
        images.put(other.payload, other.attachment)
        points.put(PointCloud(data=b"1234").SerializeToString())

    with repeating(publish, 0.02):
        assert eventually(lambda: in_ros.left_out["/demo/tof/depth/image: of another size than its camera's"])
        assert eventually(lambda: in_ros.left_out["/demo/tof/depth/points: unreadable"])
    whole = PointCloud(point_stride=4, data=b"1234").SerializeToString()
    with repeating(lambda: points.put(whole), 0.02):
        assert cloud.next()[0].width == 1
    with imaging(bus):
        assert depth.next()[0].height == HEIGHT


def test_without_a_subscription_images_are_not_converted(bus, in_ros, ros_router):
    with imaging(bus):
        assert eventually(lambda: "/demo/tof/depth/image" in in_ros.published)
    assert in_ros.published["/demo/tof/depth/image"] == 0


def test_a_router_that_is_not_there_is_told(endpoint):
    with pytest.raises(UnreachableError, match=f"nothing answers at {endpoint}"):
        RosNode(endpoint, "abs_demo", 0)
