"""Cameras of an OAK by head: intrinsics and poses from the first images, or poses from the calibration."""

from collections.abc import Mapping

from calib import pose
from calib.camera import Camera
from calib.pose import Pose
from drivers.contract.frame import Kind
from drivers.oak.eeprom import NO_SOCKET, Extrinsics, Poses
from drivers.oak.images.lens import OWN
from drivers.oak.images.picture import Picture, PictureError, camera
from drivers.oak.roles import REFERENCES, Role


def cameras(pictures: Mapping[Role, Picture], poses: Poses) -> dict[str, Camera]:
    """Camera of every head.

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
    for role, picture in pictures.items():
        if role.kind == Kind.DEPTH and any(picture.coefficients[OWN:]):
            # Such a lens is fitted by one that is turned, and z would have to be turned with it.
            raise PictureError(f"{role.sensor}/{role.stream}: depth behind a lens with thin-prism or tilt coefficients")
    return {sensor: camera(picture, _between(reference, sensor, first, poses)) for sensor, picture in first.items()}


def _between(reference: str, sensor: str, first: Mapping[str, Picture], poses: Poses) -> Pose:
    if sensor == reference:
        return pose.identity()
    views = (_view(name, first[name], poses) for name in (reference, sensor))
    return poses.between_views(*views)


def _view(sensor: str, picture: Picture, poses: Poses) -> Extrinsics:
    """Pose of a head's view: as its images have it, else that of their camera, rectified for stereo images.

    The number of the camera that comes with depth need not be that of the camera whose view it was aligned to.
    """
    if picture.extrinsics.to != NO_SOCKET:
        return picture.extrinsics
    rectification = poses.rectified(picture.socket) if sensor in {"depth", "right"} else pose.identity()
    return Extrinsics(picture.socket, pose.inverse(rectification))
