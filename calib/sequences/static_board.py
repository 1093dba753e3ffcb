"""Static board as the target of a sequence: pose from its corners, with uncertainty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calib import pose
from calib.board.plane import region
from calib.board.views import CornerView
from calib.camera import Camera
from calib.noise.base import NoiseError
from calib.pose import Pose
from calib.sequences import plane
from calib.solve.start.board_poses import pose_candidates

#: Increments for finite differences with respect to a pose [rad, m].
_STEP = 1e-5
#: Lower bound of the deviation of corners [px].
_MIN_PX = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class StaticBoard:
    """Board in front of a depth sensor.

    Attributes:
        seen_by: sensor whose image determined the pose.
        corners: number of points.
        rms_px: root mean square reprojection error [px].
        plane: q (3,) [1/m] of its plane, q · X = 1 in the depth sensor's frame.
        inside: pixels (height, width) of the depth sensor well inside the hull of the points.
        uncertainty: deviation of the true distances of these pixels due to corner noise, root mean square [m]; excludes
            errors of the cameras and of the size of the board's squares.
    """

    seen_by: str
    corners: int
    rms_px: float
    plane: NDArray[np.float64]
    inside: NDArray[np.bool_]
    uncertainty: float


def locate(view: CornerView, observer: Camera, depth: Camera) -> StaticBoard:
    """Estimates the pose of a board seen by one sensor relative to a depth sensor, which may be the same.

    Args:
        view: view of the board.
        observer: camera of the view's sensor, with its pose in the rig.
        depth: camera of the depth sensor, likewise.

    Raises:
        NoiseError: no valid board pose, or the board is outside the depth sensor's view.
    """
    found = [_refined(observer.T_rs @ each.T_sb, view, observer) for each in pose_candidates(observer, view)]
    if not found:
        raise NoiseError(f"{view.sensor}: no pose of the board explains where its corners are seen")
    T_rb, misses, jacobian = min(found, key=lambda each: float(np.sum(np.square(each[1]))))
    inside = _inside(depth, pose.transform(T_rb, view.points_b))
    if not inside.any():
        raise NoiseError(f"the depth sensor does not see the board that {view.sensor} sees")
    sigma = max(float(np.sqrt(np.sum(np.square(misses)) / max(len(misses) - 6, 1))), _MIN_PX)
    covariance = sigma**2 * np.linalg.inv(jacobian.T @ jacobian)
    rays = depth.rays()[inside]
    distance_jacobian = np.stack([_slope(T_rb, number, depth, rays) for number in range(6)], axis=1)
    variance = np.einsum("ni,ij,nj->n", distance_jacobian, covariance, distance_jacobian)
    rms_px = float(np.sqrt(2 * np.mean(np.square(misses))))
    uncertainty = float(np.sqrt(np.mean(variance)))
    return StaticBoard(view.sensor, len(view.points_b), rms_px, _plane(T_rb, depth), inside, uncertainty)


def _refined(T_rb: Pose, view: CornerView, camera: Camera) -> tuple[Pose, NDArray[np.float64], NDArray[np.float64]]:
    """Pose refined by least squares, reprojection errors (2n,) [px] and their Jacobian."""

    def misses(increment: NDArray[np.float64]) -> NDArray[np.float64]:
        shown = camera.project(pose.transform(_moved(T_rb, increment), view.points_b))
        return np.nan_to_num(shown - view.pixels, nan=1e3).ravel()

    result = least_squares(misses, np.zeros(6), method="lm")
    return _moved(T_rb, result.x), result.fun, np.asarray(result.jac)


def _moved(T_rb: Pose, increment: NDArray[np.float64]) -> Pose:
    """Pose after an increment: rotation about the board's own origin, translation in the rig's frame."""
    moved = T_rb @ pose.from_rotation_vector(increment[:3], np.zeros(3))
    moved[:3, 3] += increment[3:]
    return moved


def _plane(T_rb: Pose, depth: Camera) -> NDArray[np.float64]:
    T_sb = depth.T_sr @ T_rb
    normal = T_sb[:3, 2]
    return normal / float(normal @ T_sb[:3, 3])


def _slope(T_rb: Pose, number: int, depth: Camera, rays: NDArray[np.floating]) -> NDArray[np.float64]:
    """Derivative of the true distances along rays (n, 3) with respect to one parameter of the pose."""
    step = _STEP * np.eye(6)[number]
    ahead, behind = (plane.radial(_plane(_moved(T_rb, sign * step), depth), rays) for sign in (1, -1))
    return (ahead - behind) / (2 * _STEP)


def _inside(depth: Camera, points_r: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels well inside the hull of points (n, 3); none if a point is outside the sensor's view."""
    shape, pixels = (depth.height, depth.width), depth.project(points_r)
    return region(pixels, shape) if np.isfinite(pixels).all() else np.zeros(shape, np.bool_)
