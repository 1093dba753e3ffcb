"""Cameras of ROS: intrinsics from sensor_msgs/CameraInfo, poses from the static transforms of tf2.

Optical frames have x right, y down and z forward (REP 103), as here.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensModel
from calib.pose import Pose


class CameraInfoError(ValueError):
    """An unusable camera; names the problem."""


class Transforms:
    """The tree of static transforms.

    Args:
        messages: contents of `/tf_static`.
    """

    def __init__(self, messages: Iterable[Any]) -> None:
        self._parents: dict[str, tuple[str, Pose]] = {}
        for message in messages:
            for one in message.transforms:
                q, t = one.transform.rotation, one.transform.translation
                T_parent_child = pose.from_quaternion([q.x, q.y, q.z, q.w], [t.x, t.y, t.z])
                self._parents[one.child_frame_id.lstrip("/")] = one.header.frame_id.lstrip("/"), T_parent_child

    def between(self, reference: str, frame: str) -> Pose:
        """The pose that maps coordinates in `frame` to those in `reference` [m].

        Raises:
            CameraInfoError: the two are not connected.
        """
        chains = [self._chain(name.lstrip("/")) for name in (reference, frame)]
        for name, T_name_frame in chains[1].items():
            if name in chains[0]:
                return pose.inverse(chains[0][name]) @ T_name_frame
        raise CameraInfoError(f"/tf_static does not say where {frame!r} is relative to {reference!r}")

    def _chain(self, frame: str) -> Mapping[str, Pose]:
        """Pose from a frame's coordinates to those of itself and of every ancestor."""
        chain, T = {frame: pose.identity()}, pose.identity()
        while frame in self._parents and self._parents[frame][0] not in chain:
            frame, T_parent_child = self._parents[frame]
            T = T_parent_child @ T
            chain[frame] = T
        return chain


def camera(info: Any, rectified: bool, T_rs: Pose) -> Camera:
    """Camera of images that come with a CameraInfo.

    Args:
        info: the message.
        rectified: True for images without distortion, for which the matrix P holds; K and the lens otherwise.
        T_rs: pose of the camera in the rig.

    Raises:
        CameraInfoError: a camera that is not calibrated, or an unsupported lens.
    """
    K = np.reshape(info.p, (3, 4)) if rectified else np.reshape(info.k, (3, 3))
    try:
        lens = Lens() if rectified else _lens(info.distortion_model, np.asarray(info.d, float))
        fx, fy, cx, cy = (float(K[index]) for index in ((0, 0), (1, 1), (0, 2), (1, 2)))
        return Camera(info.width, info.height, fx, fy, cx, cy, lens, T_rs)
    except CameraInfoError:
        raise
    except ValueError as error:
        raise CameraInfoError(f"the camera is not calibrated: {error}") from error


def _lens(model: str, coefficients: np.ndarray) -> LensModel:
    if model == "equidistant":  # not a pinhole without coefficients
        return KannalaBrandt(coefficients)
    if not np.any(coefficients):
        return Lens()
    if model in {"plumb_bob", "rational_polynomial"} and not np.any(coefficients[8:]):
        return Lens(coefficients[:8])
    raise CameraInfoError(
        f"the lens {model!r} with {len(coefficients)} coefficients is no plumb_bob, rational_polynomial of eight "
        "coefficients or equidistant one; import rectified images"
    )
