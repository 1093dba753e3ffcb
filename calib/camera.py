"""Calibrated camera: projection of eq. 10 and its inverse."""

import functools
import hashlib
from dataclasses import dataclass, field
from numbers import Integral, Real

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.lenses import lookup
from calib.lenses.lens import Lens, LensModel
from calib.pose import Pose

#: Largest image [pixels along a side]: a larger one is a mistake, and no memory holds its rays.
MAX_SIDE_PX = 65_535


class CameraError(ValueError):
    """Invalid camera parameters; names parameter, value and what is allowed."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Projection `P_s` of one sensor s: camera matrix, lens and pose in the rig.

    Pixel centres lie at integer coordinates: the image covers [-0.5, width - 0.5] × [-0.5, height - 0.5]. Cameras with
    the same parameters are equal.

    Attributes:
        width, height: image size [px].
        fx, fy, cx, cy: camera matrix `K_s` [px].
        lens: distortion `D_s`.
        T_rs: pose that maps sensor coordinates (z forward, x right, y down) to rig coordinates, shape (4, 4) [m]; a
            read-only copy.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    lens: LensModel = field(default_factory=Lens)
    T_rs: Pose = field(default_factory=pose.identity)

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            size = getattr(self, name)
            if not isinstance(size, Integral) or not 1 <= int(size) <= MAX_SIDE_PX:
                raise CameraError(f"{name} = {size!r}: must be a whole number of pixels, 1 to {MAX_SIDE_PX}")
        for name in ("fx", "fy", "cx", "cy"):
            _check_number(name, getattr(self, name), positive=name in ("fx", "fy"))
        # The first of them is recognised by its class; all that a protocol asks for takes fifty times as long to see.
        if not isinstance(self.lens, (Lens, LensModel)):
            raise CameraError(f"lens = {self.lens!r}: must be a lens model, such as Lens(…) or Fisheye(…)")
        object.__setattr__(self, "T_rs", _pose(self.T_rs))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Camera) and self._parameters == other._parameters

    def __hash__(self) -> int:
        return hash(self._parameters)

    @property
    def _parameters(self) -> tuple[object, ...]:
        matrix = self.width, self.height, self.fx, self.fy, self.cx, self.cy
        return (*matrix, self.lens, *self.T_rs.ravel())

    @property
    def center(self) -> NDArray[np.float64]:
        """Camera centre `c_s` in rig coordinates, shape (3,) [m]."""
        return self.T_rs[:3, 3]

    @functools.cached_property
    def T_sr(self) -> Pose:
        """Pose that maps rig coordinates to sensor coordinates; read-only."""
        inverse = pose.inverse(self.T_rs)
        inverse.setflags(write=False)
        return inverse

    @property
    def calib_id(self) -> str:
        """Short hash of all parameters of the projection; part of frames and estimates."""
        numbers = [self.width, self.height, self.fx, self.fy, self.cx, self.cy, *self.lens.coefficients]
        payload = np.concatenate([numbers, self.T_rs.ravel()]).astype("<f8").tobytes()
        # The name of the first lens model is left out, so that ids in older recordings stay valid.
        kind = b"" if isinstance(self.lens, Lens) else self.lens.name.encode()
        return hashlib.sha256(payload + kind).hexdigest()[:16]

    @functools.cached_property
    def lookup(self) -> lookup.Lookup:
        """Viewing direction of every pixel; computed on first use.

        Raises:
            LensError: if the lens has no inverse somewhere on the image.
        """
        return lookup.build((self.width, self.height), (self.fx, self.fy, self.cx, self.cy), self.lens)

    @functools.cached_property
    def field_radius(self) -> float:
        """Largest radius of (x/z, y/z) in the field of view, with a margin of one pixel.

        Outside it, the distortion polynomial may map points back into the image or overflow.

        Raises:
            LensError: if the lens has no inverse somewhere on the image.
        """
        return self.lookup.radius * (1 + 2 / min(self.width, self.height)) + 1 / min(self.fx, self.fy)

    def in_field(self, points_r: NDArray[np.floating]) -> NDArray[np.bool_]:
        """True for rig points (…, 3) [m] in the field of view, of which the image may show a part only.

        Raises:
            LensError: if the lens has no inverse somewhere on the image.
        """
        x, y, depth = np.moveaxis(pose.transform(self.T_sr, np.asarray(points_r, np.float64)), -1, 0)
        return np.asarray(np.hypot(x, y) < self.field_radius * depth)

    def project(self, points_r: NDArray[np.floating]) -> NDArray[np.float64]:
        """Pixel coordinates (…, 2) of rig points (…, 3) [m], eq. 10; NaN for points on or behind the camera plane.

        Raises:
            CameraError: the points are no array of three coordinates each.
        """
        points_s = pose.transform(self.T_sr, _points("points_r", points_r))
        depth = points_s[..., 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            ideal = np.where(depth > 0, points_s[..., :2] / depth, np.nan)
        return self.lens.distort(ideal) * (self.fx, self.fy) + (self.cx, self.cy)

    def projection_jacobian(self, points_r: NDArray[np.floating]) -> NDArray[np.float64]:
        """Jacobian (…, 2, 3) of `project` with respect to rig points (…, 3) in front of the camera [px/m]."""
        points_s = pose.transform(self.T_sr, np.asarray(points_r, np.float64))
        depth = points_s[..., 2, None, None]
        ideal = points_s[..., :2] / depth[..., 0]
        by_ideal = self.lens.jacobian(ideal) * np.array([[self.fx], [self.fy]]) / depth
        by_depth = -np.sum(by_ideal * ideal[..., None, :], axis=-1, keepdims=True)
        by_point = np.concatenate([by_ideal, by_depth], axis=-1)
        # One matrix product for all points is several times faster than n small ones.
        return (by_point.reshape(-1, 3) @ self.T_rs[:3, :3].T).reshape(by_point.shape)

    def distance(self, points_r: NDArray[np.floating]) -> NDArray[np.float64]:
        """Radial distance (…,) [m] from the camera centre, eq. 11; CameraError as of `project`."""
        return np.linalg.norm(_points("points_r", points_r) - self.center, axis=-1)

    def rays(self) -> NDArray[np.float64]:
        """Unit direction of every pixel's line of sight in sensor coordinates, shape (height, width, 3).

        Raises:
            LensError: if the lens has no inverse somewhere on the image.
        """
        return self.lookup.rays

    def directions(self, pixels: NDArray[np.number]) -> NDArray[np.float64]:
        """Unit directions (…, 3) in sensor coordinates of the lines of sight through pixel coordinates (…, 2).

        Raises:
            LensError: if the lens has no inverse at one of them.
        """
        ideal = self.lens.undistort((np.asarray(pixels, np.float64) - (self.cx, self.cy)) / (self.fx, self.fy))
        directions = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1)
        return directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def unproject(self, distance: NDArray[np.floating]) -> NDArray[np.float64]:
        """Rig points (height, width, 3) [m] of a radial distance image [m]; NaN stays NaN.

        Raises:
            CameraError: the image is not of the camera's size.
        """
        if np.shape(distance) != (self.height, self.width):
            allowed = f"must be {(self.height, self.width)}, (height, width)"
            raise CameraError(f"distance has shape {np.shape(distance)}: {allowed}")
        return pose.transform(self.T_rs, self.lookup.rays * np.asarray(distance, np.float64)[..., None])


def _points(name: str, given: object) -> NDArray[np.float64]:
    """Points (…, 3) as an array; CameraError if they are none."""
    try:
        points = np.asarray(given, np.float64)
    except (TypeError, ValueError) as error:
        raise CameraError(f"{name} = {given!r}: must be an array (…, 3) of metres") from error
    if points.shape[-1:] != (3,):
        raise CameraError(f"{name} has shape {points.shape}: must be (…, 3), x, y and z in metres")
    return points


def _check_number(name: str, value: object, *, positive: bool) -> None:
    number = float(value) if isinstance(value, Real) else np.nan
    if not np.isfinite(number) or (positive and number <= 0):
        raise CameraError(f"{name} = {value!r}: must be {'positive and ' if positive else ''}finite")


def _pose(given: object) -> Pose:
    """The pose as an array; CameraError if it is none."""
    try:
        T_rs = np.array(given, np.float64)
    except (TypeError, ValueError):
        T_rs = np.zeros(0)
    if not pose.is_pose(T_rs):
        shown = np.array2string(T_rs, separator=", ") if T_rs.ndim == 2 else repr(given)
        raise CameraError(f"T_rs = {shown}: must be a rigid 4 × 4 pose (orthonormal rotation, last row 0 0 0 1)")
    T_rs.setflags(write=False)
    return T_rs
