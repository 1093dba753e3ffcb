"""Calibrations as ROS messages."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from absmsg.v1.common_pb2 import Header
from numpy.typing import NDArray

from abs_client.camera import Camera
from abs_client.ros2 import cdr

#: Coefficients that `plumb_bob` has; OpenCV's order has more, for `rational_polynomial`.
PLUMB_BOB = 5


def info(camera: Camera, header: Any, distorted: bool) -> Any:
    """A sensor_msgs/CameraInfo.

    Args:
        camera: the camera.
        header: that of the image.
        distorted: False if the images are without its lens distortion.
    """
    model, lens = _lens(camera.lens_model if distorted else "", camera.lens if distorted else ())
    projection = np.zeros((3, 4))
    projection[:, :3] = camera.K
    return cdr.make(
        "sensor_msgs/msg/CameraInfo",
        header=header,
        height=camera.height,
        width=camera.width,
        distortion_model=model,
        d=lens,
        k=camera.K.ravel(),
        r=np.eye(3).ravel(),
        p=projection.ravel(),
        binning_x=0,
        binning_y=0,
        roi=cdr.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def _lens(model: str, coefficients: Sequence[float]) -> tuple[str, NDArray[np.float64]]:
    lens = np.pad(np.array(coefficients, float), (0, 8 - len(coefficients)))
    if model == "fisheye":
        return "equidistant", lens[:4]
    return ("rational_polynomial", lens) if lens[PLUMB_BOB:].any() else ("plumb_bob", lens[:PLUMB_BOB])


def transforms(cameras: Mapping[str, Camera], rig: str) -> Any:
    """A tf2_msgs/TFMessage with the pose of every sensor; its frame is `<rig>/<sensor>`, that of the rig `<rig>`."""
    return cdr.make(
        "tf2_msgs/msg/TFMessage",
        transforms=[
            cdr.make(
                "geometry_msgs/msg/TransformStamped",
                header=cdr.header(Header(), rig),  # time does not matter in /tf_static
                child_frame_id=f"{rig}/{sensor}",
                transform=cdr.make(
                    "geometry_msgs/msg/Transform",
                    translation=cdr.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", camera.T_rs[:3, 3].tolist()))),
                    rotation=cdr.make(
                        "geometry_msgs/msg/Quaternion", **dict(zip("xyzw", quaternion(camera.T_rs[:3, :3]).tolist()))
                    ),
                ),
            )
            for sensor, camera in sorted(cameras.items())
        ],
    )


def quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """x, y, z, w of a rotation (3, 3), w ≥ 0.

    The eigenvector of Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix" (2000).
    """
    symmetric = np.zeros((4, 4))
    symmetric[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    symmetric[3, :3] = symmetric[:3, 3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    symmetric[3, 3] = np.trace(R)
    xyzw = np.linalg.eigh(symmetric)[1][:, -1]
    return -xyzw if xyzw[3] < 0 else xyzw
