"""Images, depth in metres along the optical axis, and points as ROS messages."""

from typing import Any

import numpy as np
from absmsg.v1.frame_info_pb2 import FrameInfo
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from numpy.typing import NDArray

from abs_client.images import Image
from abs_client.ros2 import cdr

#: Kinds of images that hold distances.
DISTANCES = frozenset({"depth", "deviation"})

# PointField's number and the bytes of each type of foxglove.PackedElementField.
_FIELDS = {
    PackedElementField.UINT8: 2,
    PackedElementField.INT8: 1,
    PackedElementField.UINT16: 4,
    PackedElementField.INT16: 3,
    PackedElementField.UINT32: 6,
    PackedElementField.INT32: 5,
    PackedElementField.FLOAT32: 7,
    PackedElementField.FLOAT64: 8,
}


def is_radial(info: FrameInfo) -> bool:
    """True if the pixels are distances from the camera centre, so that `message` needs the camera's `shares`."""
    return info.kind in DISTANCES and info.geometry == FrameInfo.GEOMETRY_RADIAL


def message(image: Image, header: Any, shares: NDArray[np.float32] | float = 1.0) -> Any:
    """A sensor_msgs/Image: of distances 32FC1 in metres (REP 118), NaN without return; others as measured.

    Args:
        image: as it was received.
        header: of the message.
        shares: of a radial image, see `rays.axial_shares`.
    """
    distances = image.info.kind in DISTANCES
    pixels = (image.values * shares).astype("<f4") if distances else image.pixels
    return cdr.make(
        "sensor_msgs/msg/Image",
        header=header,
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding="32FC1" if distances else image.encoding,
        is_bigendian=0,
        step=pixels.nbytes // pixels.shape[0],
        data=cdr.flat(pixels),
    )


def points(sent: PointCloud, frame_id: str) -> Any:
    """A sensor_msgs/PointCloud2 of the same points [m]."""
    stamp = cdr.make("builtin_interfaces/msg/Time", sec=sent.timestamp.seconds, nanosec=sent.timestamp.nanos)
    header = cdr.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)
    fields = [(one.name, one.offset, _FIELDS[one.type]) for one in sent.fields if one.type in _FIELDS]
    return cdr.cloud(header, fields, sent.point_stride, sent.data)
