"""Streams and cameras of librealsense."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.pose import Pose
from drivers.contract.frame import Geometry, Kind

#: Distortion models equivalent to OpenCV's k1 k2 p1 p2 k3. librealsense uses all of them for forward projection;
#: "modified" and "inverse" apply p1 and p2 after the radial part, a difference of a few thousandths of a pixel.
BROWN_CONRADY = ("brown conrady", "modified brown conrady", "inverse brown conrady")


class StreamError(ValueError):
    """An unusable stream; names it and the problem."""


@dataclass(frozen=True, slots=True)
class Role:
    """Head, name and properties of a stream.

    Attributes:
        sensor: the head.
        stream: its name.
        kind: kind of image.
        geometry: type of distance of depth.
        exposure_unit_s: unit of its exposure times [s].
    """

    sensor: str
    stream: str
    kind: Kind
    geometry: Geometry = Geometry.NONE
    exposure_unit_s: float = 1e-6


#: By the SDK's stream type and index. Stereo cameras number their imagers 1 (left) and 2 (right) and give depth as the
#: left one sees it; those with one imager (L5xx) have infra-red 0 and confidence behind the same lens as depth.
ROLES: Mapping[tuple[str, int], Role] = {
    ("depth", 0): Role("depth", "depth", Kind.DEPTH, Geometry.Z),
    ("infrared", 0): Role("depth", "ir", Kind.IR),
    ("confidence", 0): Role("depth", "confidence", Kind.CONFIDENCE),
    ("infrared", 1): Role("left", "ir", Kind.IR),
    ("infrared", 2): Role("right", "ir", Kind.IR),
    ("color", 0): Role("color", "color", Kind.COLOR, exposure_unit_s=1e-4),  # unit of USB video devices
}


def role_beside(key: tuple[str, int], kinds: Collection[str]) -> Role | None:
    """Role of a stream of a sensor; None if it is not supported.

    The D405 has no colour camera: its colours are a stream of the depth sensor, which has the exposure's option and
    metadata, in microseconds (librealsense, src/ds/d400/d400-color.cpp).

    Args:
        key: the SDK's type and index of the stream.
        kinds: types of all streams of the same sensor.
    """
    role = ROLES.get(key)
    if role is None or "depth" not in kinds:
        return role
    return replace(role, exposure_unit_s=ROLES["depth", 0].exposure_unit_s)


def camera(
    name: str,
    size: tuple[int, int],
    matrix: tuple[float, float, float, float],
    model: str,
    coefficients: ArrayLike,
    T_rs: Pose,
) -> Camera:
    """Camera from librealsense's parameters; both have the origin at the centre of the first pixel.

    Args:
        name: of the stream, for messages.
        size: width and height [px].
        matrix: fx, fy, cx, cy [px].
        model: distortion model, in lower case with blanks.
        coefficients: five of them.
        T_rs: pose that maps sensor coordinates to those of the depth head [m].

    Raises:
        StreamError: unsupported distortion model, or invalid parameters.
    """
    try:
        lens = Lens(np.asarray(coefficients, float))
        if not lens.is_pinhole and model not in BROWN_CONRADY:
            raise StreamError(f"{name}: distortion {model!r} is none of {', '.join(BROWN_CONRADY)}")
        return Camera(*size, *matrix, lens, T_rs)
    except ValueError as error:
        raise error if isinstance(error, StreamError) else StreamError(f"{name}: {error}") from error
