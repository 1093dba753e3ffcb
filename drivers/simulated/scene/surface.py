"""Material points of a rectangle rolled onto a cylinder."""

import numpy as np
from numpy.typing import NDArray

from calib import pose
from drivers.simulated.scene.motion import Placement


def surface_points(placement: Placement, a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Rig coordinates (…, 3) [m] of material points.

    Args:
        placement: pose and bend.
        a, b: material coordinates (…) on the flat sheet from its centre, to the right and down [m].
    """
    cosine, sine = np.cos(placement.direction), np.sin(placement.direction)
    s = cosine * a + sine * b - placement.offset
    t = cosine * b - sine * a
    angle = placement.curvature * s
    # s sin(κs)/κs and κs² (1 − cos κs)/(κs)², exact as κ → 0: numpy.sinc(x) is sin(πx)/πx.
    along = s * np.sinc(angle / np.pi)
    up = 0.5 * placement.curvature * s**2 * np.sinc(angle / (2 * np.pi)) ** 2
    return pose.transform(placement.T_rb, np.stack([along, t, up], axis=-1))
