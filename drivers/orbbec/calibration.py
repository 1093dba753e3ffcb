"""Cameras of Orbbec's factory calibration."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.pose import Pose
from drivers.orbbec.streams import Stream, StreamError

#: Distortion models with the equations of OpenCV's k1 k2 p1 p2 k3 k4 k5 k6 (OrbbecSDK_v2, CoordinateUtil.cpp).
BROWN_CONRADY = ("BROWN_CONRADY", "BROWN_CONRADY_K6")
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def cameras(streams: Iterable[Stream]) -> Mapping[str, Camera]:
    """Cameras by head; the rig's frame is that of depth, or of the first stream without depth.

    Raises:
        StreamError: an invalid camera, or streams of one head that differ in size.
    """
    first: dict[str, Stream] = {}
    for stream in streams:
        size, of_head = _size(stream), _size(first.setdefault(stream.role.sensor, stream))
        if size != of_head:
            name = f"{stream.role.sensor}/{stream.role.stream}"
            raise StreamError(f"{name} has {size} pixels and the others of its head {of_head}: choose one size")
    reference = first.get("depth", next(iter(first.values()), None))
    return {head: _camera(stream, reference) for head, stream in first.items()}


def _camera(stream: Stream, reference: Stream | None) -> Camera:
    name, profile = f"{stream.role.sensor}/{stream.role.stream}", stream.profile
    intrinsic = profile.get_intrinsic()
    if not intrinsic.width or not intrinsic.fx:
        raise StreamError(f"{name}: the camera tells no calibration of it")
    matrix = intrinsic.fx, intrinsic.fy, intrinsic.cx, intrinsic.cy
    try:
        return Camera(intrinsic.width, intrinsic.height, *matrix, _lens(name, profile), _pose(name, stream, reference))
    except ValueError as error:
        raise error if isinstance(error, StreamError) else StreamError(f"{name}: {error}") from error


def _lens(name: str, profile: Any) -> Lens:
    distortion = profile.get_distortion()
    lens = Lens(np.array([getattr(distortion, coefficient) for coefficient in _COEFFICIENTS], float))
    if not lens.is_pinhole and distortion.model.name not in BROWN_CONRADY:
        raise StreamError(f"{name}: distortion {distortion.model.name} is none of {', '.join(BROWN_CONRADY)}")
    return lens


def _pose(name: str, stream: Stream, reference: Stream | None) -> Pose:
    """Maps the stream's coordinates to those of the reference [m]; the SDK has rotations by rows and millimetres."""
    if reference is None or stream is reference:
        return pose.identity()
    try:
        extrinsic = stream.profile.get_extrinsic_to(reference.profile)
    except Exception as error:  # the SDK's exceptions have no common base
        raise StreamError(f"{name}: the camera tells no pose of it ({error}); leave it out of the address") from error
    rotation = np.asarray(extrinsic.rot, float).reshape(3, 3)
    return pose.from_rotation(rotation, np.asarray(extrinsic.transform, float).ravel() * 1e-3)


def _size(stream: Stream) -> str:
    return f"{stream.profile.get_width()}x{stream.profile.get_height()}"
