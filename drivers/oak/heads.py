"""The cameras of an OAK by head: what their first pictures say, where the calibration puts them."""

from collections.abc import Mapping

from calib import pose
from calib.camera import Camera
from calib.pose import Pose
from drivers.oak.eeprom import Poses
from drivers.oak.picture import Picture, camera
from drivers.oak.roles import REFERENCES, Role


def cameras(pictures: Mapping[Role, Picture], poses: Poses) -> dict[str, Camera]:
    """The camera of every head.

    Args:
        pictures: the first of every stream.
        poses: where the cameras are.

    Returns:
        By head; the rig's frame is that of the first of `REFERENCES` that there is.

    Raises:
        PictureError: a picture does not say what took it.
        EepromError: nothing is known of where a camera is.
    """
    # Of the streams of one head, the first tells: they have the same geometry, but not all of them say so.
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
    """The pose that maps coordinates of a camera to those of its images: stereo images are rectified."""
    return poses.rectified(first[sensor].socket) if sensor in {"depth", "right"} else pose.identity()
