"""Rigid transform of a deformed object, applied after all bends."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


@kernel
def place(
    rotation: NDArray[np.float64], translation: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[tuple[np.float32, ...], tuple[np.float32, ...], tuple[np.float32, ...]]:
    """Rows of the transform (3, 4) from an object to the rig, as tuples, which a loop keeps in registers.

    Args:
        rotation: vector (3,) [rad] about the object's origin.
        translation: (3,) [m].
        pose: of the object in the rig at rest (3, 4).
    """
    x, y, z = rotation[0], rotation[1], rotation[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    # Rodrigues' formula, with its series near zero.
    a = np.sin(angle) / angle if square > 1e-8 else 1 - square / 6
    b = (1 - np.cos(angle)) / square if square > 1e-8 else 0.5 - square / 24
    return (
        _row(1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y, pose, pose[0, 3] + translation[0]),
        _row(b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x, pose, pose[1, 3] + translation[1]),
        _row(b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y), pose, pose[2, 3] + translation[2]),
    )


@kernel
def _row(r0: float, r1: float, r2: float, pose: NDArray[np.float64], shift: float) -> tuple[np.float32, ...]:
    """One row of a rotation times the pose's rotation, and a translation."""
    return (
        np.float32(r0 * pose[0, 0] + r1 * pose[1, 0] + r2 * pose[2, 0]),
        np.float32(r0 * pose[0, 1] + r1 * pose[1, 1] + r2 * pose[2, 1]),
        np.float32(r0 * pose[0, 2] + r1 * pose[1, 2] + r2 * pose[2, 2]),
        np.float32(shift),
    )
