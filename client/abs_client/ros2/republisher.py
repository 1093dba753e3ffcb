"""Receives what a rig publishes, as any application does, and publishes it as ROS messages."""

import threading
from collections import Counter
from collections.abc import Mapping
from functools import partial

import numpy as np
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import SensorModel
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from numpy.typing import NDArray

from abs_client import images as received_images
from abs_client.camera import Camera, camera
from abs_client.connection.link import Link
from abs_client.connection.received import Received, decoded
from abs_client.estimates import states
from abs_client.estimates.state import State, Status
from abs_client.images import Image, ImageError
from abs_client.ros2 import cameras, cdr, diagnostics, estimates, images, rays
from abs_client.ros2.layout import Qos, ros_name
from abs_client.ros2.node import RosNode
from abs_client.stream import Stream

#: Of /tf_static: the newest, for every node that comes later.
LATCHED = Qos(depth=1, transient_local=True)
#: Pause between two searches for trackers that began later [s].
POLL_S = 1.0
#: By when the threads that publish estimates have ended after their link has [s].
END_S = 2.0


class Republisher:
    """One rig in the ROS graph; works in threads of its own until its link is closed.

    Args:
        link: to the rig.
        node: in the ROS graph.
        maximum_age_s: estimates that are older are left out.

    Attributes:
        left_out: what was received and not published, or not received at all, by cause.
    """

    def __init__(self, link: Link, node: RosNode, maximum_age_s: float) -> None:
        self._link = link
        self._node = node
        self._maximum_age_s = maximum_age_s
        self._prefix = f"/{ros_name(link.rig)}"
        self._cameras: Mapping[str, Camera] = {}
        self._models: dict[str, bytes] = {}
        self._shares: dict[tuple[bytes, bool], NDArray[np.float32]] = {}
        self._last: dict[str, tuple[str, int]] = {}
        self._trackers: dict[str, threading.Thread] = {}
        self.left_out: Counter[str] = Counter()
        link.subscribe("*/model", self._on_model)
        link.ask("*/model", self._on_model)
        link.subscribe("*/*/image", self._on_image)
        link.subscribe("*/*/points", self._on_points)
        link.subscribe("health/**", self._on_health)

    @property
    def published(self) -> Mapping[str, int]:
        """Messages so far, by topic of ROS; those for which there is no subscription are not made."""
        return self._node.published

    def run(self, end: threading.Event) -> None:
        """Searches for trackers, and publishes its own counters, once a second until `end`; then closes the link."""
        while not end.wait(POLL_S):
            for tracker in self._link.trackers() - self._trackers.keys():
                stream = states.states(self._link, tracker, self._maximum_age_s)
                self._trackers[tracker] = threading.Thread(target=self._follow, args=(tracker, stream), daemon=True)
                self._trackers[tracker].start()
            self._tell()
        self._link.close()
        for thread in self._trackers.values():
            thread.join(END_S)

    def _follow(self, tracker: str, stream: Stream[State]) -> None:
        for state in stream:
            self._publish_state(tracker, state)
            self.left_out[f"{tracker}: estimates that newer ones replaced, or too old"] = stream.skipped

    def _publish_state(self, tracker: str, state: State) -> None:
        rig, topic = self._link.rig, f"{self._prefix}/{ros_name(tracker)}"
        publish = self._node.publish
        publish(f"{topic}/mesh", "visualization_msgs/msg/Marker", lambda: estimates.marker(state, rig, tracker))
        publish(f"{topic}/status", "diagnostic_msgs/msg/DiagnosticArray", lambda: estimates.status(state, rig, tracker))
        if state.status is not Status.STALE:
            publish(f"{topic}/vertices", "sensor_msgs/msg/PointCloud2", lambda: estimates.vertices(state, rig))
            publish(f"{topic}/theta", "std_msgs/msg/Float64MultiArray", lambda: estimates.theta(state))

    def _on_model(self, one: Received) -> None:
        model = decoded(SensorModel, one)
        content = _content(model)
        if self._models.get(model.sensor) == content:
            return
        self._models[model.sensor] = content
        self._cameras = {**self._cameras, model.sensor: camera(model)}
        transforms = partial(cameras.transforms, self._cameras, self._link.rig)
        self._node.publish("/tf_static", "tf2_msgs/msg/TFMessage", transforms, LATCHED)

    def _on_image(self, one: Received) -> None:
        topic = self._topic(one)
        try:
            image = received_images.read(one)
        except ImageError:
            self.left_out[f"{topic}: unreadable"] += 1
            return
        self._count(topic, image.info.header)
        view = image.info.aligned_to or image.info.sensor
        if view not in self._cameras:
            self.left_out[f"{topic}: before the camera was known"] += 1
            return
        if images.is_radial(image.info) and image.pixels.shape != self._size(view):
            # Its calibration comes by another thread: for a moment, that of a new resolution is not there yet.
            self.left_out[f"{topic}: of another size than its camera's"] += 1
            return
        header = cdr.header(image.info.header, f"{self._link.rig}/{view}")
        self._node.publish(
            topic, "sensor_msgs/msg/Image", lambda: images.message(image, header, self._axial(view, image))
        )
        base, distorted = topic.rpartition("/")[0], not image.info.undistorted
        info = partial(cameras.info, self._cameras[view], header, distorted)
        self._node.publish(f"{base}/camera_info", "sensor_msgs/msg/CameraInfo", info)

    def _size(self, view: str) -> tuple[int, int]:
        return self._cameras[view].height, self._cameras[view].width

    def _axial(self, view: str, image: Image) -> NDArray[np.float32] | float:
        if not images.is_radial(image.info):
            return 1.0
        known = self._models[view], not image.info.undistorted
        if known not in self._shares:
            self._shares[known] = rays.axial_shares(self._cameras[view], known[1])
        return self._shares[known]

    def _on_points(self, one: Received) -> None:
        cloud = decoded(PointCloud, one)
        topic, frame = self._topic(one), f"{self._link.rig}/{cloud.frame_id}"
        if not cloud.point_stride or len(cloud.data) % cloud.point_stride:
            self.left_out[f"{topic}: unreadable"] += 1
            return
        self._node.publish(topic, "sensor_msgs/msg/PointCloud2", lambda: images.points(cloud, frame))

    def _on_health(self, one: Received) -> None:
        health = decoded(Health, one)
        self._count(self._topic(one), health.header)
        array = partial(diagnostics.health, health, self._link.rig)
        self._node.publish("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", array)

    def _tell(self) -> None:
        rig = self._link.rig
        missing = {**self.left_out, **self._link.malformed}
        counters, lost = {**self._node.published, **missing}, sum(missing.values())
        said = f"{lost} messages of the rig were not published" if lost else "every message of the rig was published"
        header = Header()
        header.stamp.GetCurrentTime()
        one = diagnostics.status(f"{rig}/ros2", rig, diagnostics.OK, said, counters)
        array = partial(diagnostics.array, cdr.header(header, ""), [one])
        self._node.publish("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", array)

    def _count(self, topic: str, header: Header) -> None:
        boot_id, seq = self._last.get(topic, ("", 0))
        if boot_id == header.boot_id:
            self.left_out[f"{topic}: lost on the way"] += max(header.seq - seq - 1, 0)
        self._last[topic] = header.boot_id, header.seq

    def _topic(self, one: Received) -> str:
        names = one.key.removeprefix(self._link.key("")).split("/")
        return "/".join([self._prefix, *map(ros_name, names)])


def _content(model: SensorModel) -> bytes:
    """All of a model but its header, which differs in every message."""
    same = SensorModel()
    same.CopyFrom(model)
    same.ClearField("header")
    return same.SerializeToString(deterministic=True)
