"""Cameras of an OAK by head: intrinsics from the first images, extrinsics from the calibration."""

from collections.abc import Mapping

from calib import pose
from calib.camera import Camera
from calib.pose import Pose
from drivers.oak.cameras.eeprom import Poses
from drivers.oak.images.picture import Picture, camera
from drivers.oak.roles import REFERENCES, Role


def cameras(pictures: Mapping[Role, Picture], poses: Poses) -> dict[str, Camera]:
    """Camera of every head.

    Args:
        pictures: first image of every stream.
        poses: extrinsics of the cameras.

    Returns:
        By head; the rig's frame is that of the first available of `REFERENCES`.

    Raises:
        PictureError: an image without camera metadata.
        EepromError: missing extrinsics of a camera.
    """
    # The first stream of each head: all have the same geometry, but not all have the metadata.
    first: dict[str, Picture] = {}
    for role, picture in pictures.items():
        first.setdefault(role.sensor, picture)
    reference = next(sensor for sensor in REFERENCES if sensor in first)
    return {sensor: camera(picture, _between(reference, sensor, first, poses)) for sensor, picture in first.items()}


def _between(reference: str, sensor: str, first: Mapping[str, Picture], poses: Poses) -> Pose:
    if sensor == reference:
        return pose.identity()
    T_rs = poses.between(first[reference].socket, first[sensor].socket)
    return _view(reference, first, poses) @ T_rs @ pose.inverse(_view(sensor, first, poses))


def _view(sensor: str, first: Mapping[str, Picture], poses: Poses) -> Pose:
    """Pose from a camera's coordinates to those of its images: the rectification of stereo images."""
    return poses.rectified(first[sensor].socket) if sensor in {"depth", "right"} else pose.identity()
