"""Writes bags of ROS 2 by rosbags."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

STAMP_NS = 1_700_000_000_100_000_000

#: Coefficients of the lens unless others are given.
LENS = (0.1, -0.02, 0.001, 0.002, 0.0)


class Take:
    """Writer of a bag.

    Args:
        path: of its folder.
        storage: `MCAP` or `SQLITE3`.
    """

    def __init__(self, path: Path, storage: str = "MCAP") -> None:
        rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="needs rosbags: make all")
        from rosbags.typesys import Stores, get_typestore

        self.path = path
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage])
        self._connections: dict[str, Any] = {}

    def __enter__(self) -> "Take":
        self._writer.open()
        return self

    def __exit__(self, *exception: object) -> None:
        self._writer.close()

    def make(self, name: str, **values: Any) -> Any:
        return self._store.types[name](**values)

    def header(self, frame_id: str, time_ns: int) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def put(self, topic: str, message: Any, time_ns: int = STAMP_NS) -> None:
        name = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, name, typestore=self._store)
        self._writer.write(self._connections[topic], time_ns, self._store.serialize_cdr(message, name))

    def service(self, topic: str) -> None:
        """A call of a service, defined as `ros2 bag record` does; rosbags cannot read that."""
        definition, digest = "int64 a\nint64 b\n---\nint64 sum\n", f"RIHS01_{'0' * 64}"
        name = "example_interfaces/srv/AddTwoInts_Event"
        self._writer.write(
            self._writer.add_connection(topic, name, msgdef=definition, rihs01=digest), STAMP_NS, b"\0\1\0\0"
        )

    def image(self, topic: str, frame_id: str, encoding: str, data: np.ndarray, time_ns: int = STAMP_NS) -> None:
        flat = np.ascontiguousarray(data).view(np.uint8).ravel()
        size = {"height": data.shape[0], "width": data.shape[1], "step": flat.size // data.shape[0]}
        values = {"header": self.header(frame_id, time_ns), "encoding": encoding, "is_bigendian": 0, "data": flat}
        self.put(topic, self.make("sensor_msgs/msg/Image", **size, **values), time_ns + 5_000_000)

    def compressed(self, topic: str, frame_id: str, form: str, content: bytes) -> None:
        data = np.frombuffer(content, np.uint8)
        message = self.make(
            "sensor_msgs/msg/CompressedImage", header=self.header(frame_id, STAMP_NS), format=form, data=data
        )
        self.put(topic, message)

    def info(
        self, topic: str, model: str = "plumb_bob", coefficients: tuple[float, ...] = LENS, focal: float = 9.0
    ) -> None:
        region = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        message = self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header("", STAMP_NS),
            height=6,
            width=8,
            distortion_model=model,
            d=np.array(coefficients),
            k=np.array([focal, 0, 4, 0, 8.0, 3, 0, 0, 1]),
            r=np.eye(3).ravel(),
            p=np.array([7.0, 0, 4.5, 0, 0, 7.5, 3.5, 0, 0, 0, 1, 0]),
            binning_x=0,
            binning_y=0,
            roi=self.make("sensor_msgs/msg/RegionOfInterest", **region),
        )
        self.put(topic, message)

    def transform(self, parent: str, child: str, turn: tuple, translation: tuple) -> None:
        rotation = self.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, turn))))
        offset = self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, translation))))
        values = self.make("geometry_msgs/msg/Transform", rotation=rotation, translation=offset)
        message = self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(parent, 0),
            child_frame_id=child,
            transform=values,
        )
        self.put("/tf_static", self.make("tf2_msgs/msg/TFMessage", transforms=[message]))
