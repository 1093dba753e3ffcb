"""ROS messages and their bytes, by rosbags."""

from typing import Any

import numpy as np
from absmsg.v1.common_pb2 import Header
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

# The types used here have the same definition, so the same hash, from Humble to Kilted.
_TYPES = get_typestore(Stores.ROS2_JAZZY)


def make(name: str, /, **values: Any) -> Any:
    """A message of the type `name`, such as `sensor_msgs/msg/Image`."""
    return _TYPES.types[name](**values)


def serialized(message: Any) -> bytes:
    """The message in CDR, little-endian, with its four bytes of encapsulation."""
    return bytes(_TYPES.serialize_cdr(message, message.__msgtype__))


def type_hash(name: str) -> str:
    """`RIHS01_…` of a type, which stands in keys and tokens."""
    return _TYPES.hash_rihs01(name)


def header(sent: Header, frame_id: str) -> Any:
    """Header with the wall-clock time of the exposure."""
    stamp = make("builtin_interfaces/msg/Time", sec=sent.stamp.seconds, nanosec=sent.stamp.nanos)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def cloud(header: Any, fields: list[tuple[str, int, int]], step: int, data: bytes) -> Any:
    """A PointCloud2 without order.

    Args:
        header: of the message.
        fields: name, offset and PointField's number of a type.
        step: bytes of a point.
        data: the points.
    """
    count = len(data) // step
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header,
        height=1,
        width=count,
        fields=[
            make("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=kind, count=1)
            for name, offset, kind in fields
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * count,
        data=np.frombuffer(data, np.uint8),
        is_dense=True,
    )


def flat(array: NDArray) -> NDArray[np.uint8]:
    """The bytes of an array."""
    return np.ascontiguousarray(array).view(np.uint8).ravel()
