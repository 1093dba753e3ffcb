"""Vectorised rotations: exponential, logarithm and left Jacobian of arrays of rotation vectors.

T. D. Barfoot, State Estimation for Robotics, chapter 7.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

#: Below this angle [rad] the series replace the closed forms, which lose digits.
SMALL = 1e-3


def cross(vectors: NDArray[np.floating]) -> NDArray[np.float64]:
    """Matrices [v]× (…, 3, 3) of vectors (…, 3): [v]× w = v × w."""
    x, y, z = np.moveaxis(np.asarray(vectors, np.float64), -1, 0)
    zero = np.zeros_like(x)
    rows = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    return rows.reshape(*x.shape, 3, 3)


def exponential(vectors: NDArray[np.floating]) -> NDArray[np.float64]:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3) [rad]."""
    return Rotation.from_rotvec(vectors).as_matrix()


def logarithm(matrices: NDArray[np.floating]) -> NDArray[np.float64]:
    """Rotation vectors (n, 3) [rad] of rotation matrices (n, 3, 3)."""
    return Rotation.from_matrix(matrices).as_rotvec()


def left_jacobian(vectors: NDArray[np.floating]) -> NDArray[np.float64]:
    """Left Jacobians J (n, 3, 3): exp(r + dr) = exp(J dr) exp(r) to first order (Barfoot, eq. 7.77)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    safe = np.maximum(angle, SMALL)
    first = np.where(angle < SMALL, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    second = np.where(angle < SMALL, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    matrix = cross(vectors)
    return np.eye(3) + first * matrix + second * matrix @ matrix
