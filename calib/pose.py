"""Rigid poses as 4 × 4 matrices. `T_ab` maps coordinates in b to coordinates in a; lengths in metres, angles in rad."""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import ArrayLike, NDArray

Pose = NDArray[np.float64]

_EYE = np.eye(4)

#: Cross-product matrices (3, 3, 3) of the axes: `_CROSS[k] @ v` is the k-th axis × v.
_CROSS = np.cross(np.eye(3)[:, None], np.eye(3)).transpose(0, 2, 1)


def identity() -> Pose:
    """Identity pose."""
    return np.eye(4)


def from_rotation_vector(rotation_vector: ArrayLike, translation: ArrayLike) -> Pose:
    """Pose with a rotation vector [rad] (axis times angle) and translation [m], both of shape (3,)."""
    T_ab = np.eye(4)
    T_ab[:3, :3] = scipy.spatial.transform.Rotation.from_rotvec(np.asarray(rotation_vector, float)).as_matrix()
    T_ab[:3, 3] = np.asarray(translation, float)
    return T_ab


def to_rotation_vector(T_ab: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation vector [rad] and translation [m] of a pose; inverse of `from_rotation_vector`."""
    return scipy.spatial.transform.Rotation.from_matrix(T_ab[:3, :3]).as_rotvec(), T_ab[:3, 3].copy()


def rotated_points_jacobian(rotation_vector: ArrayLike, turned: NDArray[np.floating]) -> NDArray[np.float64]:
    """Jacobian (n, 3, 3) of rotated points R p with respect to the rotation vector (3,) of R: −[R p]× J.

    J = I + (1 − cos θ)/θ² [r]× + (θ − sin θ)/θ³ [r]×² is the left Jacobian of the rotations (T. D. Barfoot, State
    Estimation for Robotics, eq. 7.77).

    Args:
        rotation_vector: r with the angle θ = ‖r‖ [rad].
        turned: R p (n, 3).
    """
    r = np.asarray(rotation_vector, np.float64)
    angle = float(np.linalg.norm(r))
    cross = np.tensordot(r, _CROSS, 1)
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    second = (angle - np.sin(angle)) / angle**3 if angle > 1e-2 else 1 / 6 - angle**2 / 120
    left = np.eye(3) + first * cross + second * cross @ cross
    return -(turned @ (_CROSS @ left).reshape(3, 9)).reshape(-1, 3, 3)


def to_quaternion(T_ab: Pose) -> NDArray[np.float64]:
    """Unit quaternion (x, y, z, w) of a pose's rotation."""
    return scipy.spatial.transform.Rotation.from_matrix(T_ab[:3, :3]).as_quat()


def from_quaternion(quaternion: ArrayLike, translation: ArrayLike) -> Pose:
    """Pose with the rotation of a quaternion (x, y, z, w) of any length but 0, and a translation (3,) [m].

    Raises:
        ValueError: a quaternion of length 0.
    """
    rotation = scipy.spatial.transform.Rotation.from_quat(np.asarray(quaternion, float))
    return from_rotation(rotation.as_matrix(), translation)


def from_rotation(rotation: ArrayLike, translation: ArrayLike, tolerance: float = 1e-3) -> Pose:
    """Pose with the rotation nearest to a rounded rotation matrix (3, 3), and a translation (3,) [m].

    Raises:
        ValueError: the matrix is farther from a rotation than `tolerance`.
    """
    given = np.asarray(rotation, float).reshape(3, 3)
    T_ab = np.eye(4)
    if np.all(np.isfinite(given)):
        left, _, right = np.linalg.svd(given)
        T_ab[:3, :3] = left @ right
    T_ab[:3, 3] = np.asarray(translation, float)
    if not np.allclose(T_ab[:3, :3], given, rtol=0, atol=tolerance) or not is_pose(T_ab):
        raise ValueError(f"{given.ravel().tolist()} and {T_ab[:3, 3].tolist()} are no rotation and translation")
    return T_ab


def nearest_rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation nearest to a matrix (3, 3) [1]; of points a.T @ b about their centres (n, 3), the one that maps b to a.

    Source: W. Kabsch, A solution for the best rotation to relate two sets of vectors, 1976.
    """
    left, _, right = np.linalg.svd(matrix)
    return left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right


def look_at(eye: ArrayLike, target: ArrayLike) -> Pose:
    """Pose `T_rs` of a camera at `eye` whose optical axis passes through `target`; its rows run along y of the rig."""
    eye_r = np.asarray(eye, float)
    forward = np.asarray(target, float) - eye_r
    forward = forward / np.linalg.norm(forward)
    right = np.cross((0.0, 1.0, 0.0), forward)
    right = right / np.linalg.norm(right)
    T_rs = np.eye(4)
    T_rs[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T_rs[:3, 3] = eye_r
    return T_rs


def inverse(T_ab: Pose) -> Pose:
    """Inverse pose `T_ba`."""
    T_ba = np.eye(4)
    T_ba[:3, :3] = T_ab[:3, :3].T
    T_ba[:3, 3] = -T_ab[:3, :3].T @ T_ab[:3, 3]
    return T_ba


def transform(T_ab: Pose, points_b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Points of shape (…, 3) [m], given in b, in coordinates of a."""
    return points_b @ T_ab[:3, :3].T + T_ab[:3, 3]


def is_pose(T_ab: NDArray[np.float64], tolerance: float = 1e-6) -> bool:
    """True if a (4, 4) matrix is a rigid pose: orthonormal rotation of determinant one, last row (0, 0, 0, 1)."""
    if T_ab.shape != (4, 4):
        return False
    rotation = T_ab[:3, :3]
    return bool(
        np.all(np.isfinite(T_ab))
        and _is_near(rotation @ rotation.T, _EYE[:3, :3], tolerance)
        and np.linalg.det(rotation) > 0
        and _is_near(T_ab[3], _EYE[3], tolerance)
    )


def _is_near(found: NDArray[np.float64], wanted: NDArray[np.float64], tolerance: float) -> bool:
    """True if finite numbers agree as in `np.allclose`, which takes ten times as long: there are thousands of poses."""
    return bool(np.all(np.abs(found - wanted) <= tolerance + 1e-5 * np.abs(wanted)))
