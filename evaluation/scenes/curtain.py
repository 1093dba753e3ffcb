"""A curtain: a sheet in wrinkles that wander along it and swell, so that its surface moves and its material hardly."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.spatial import KDTree

from evaluation.scenes.bent_sheet import SIZE, places

#: Distance between two wrinkles along the line between the curtain's sides, and where its middle is [m].
WRINKLE_M, CENTER = 0.1, (0.0, 0.0, 0.6)

#: Points at which the length of the profile is known.
_PROFILE = 2001


@dataclass(frozen=True, slots=True)
class CurtainState:
    """The curtain at one state.

    Attributes:
        height_m: of the wrinkles, half of what is between front and back [m].
        phase: of the wrinkles [rad].
    """

    height_m: float
    phase: float

    def points(self, material: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (…, 3) [m] of material points (…, 2) [m]: on a cylinder, so the bending is isometric."""
        x = np.linspace(-0.5, 0.5, _PROFILE) * SIZE[0]  # it never reaches as far, as it is longer than its chord
        turn = 2 * np.pi / WRINKLE_M
        slope = self.height_m * turn * np.cos(turn * x + self.phase)
        along = cumulative_simpson(np.hypot(1, slope), x=x, initial=0)
        x = np.interp(material[..., 0] + along[_PROFILE // 2], along, x)
        depth = self.height_m * np.sin(turn * x + self.phase)
        return np.stack([x, material[..., 1], depth], axis=-1) + np.array(CENTER)

    def material(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Places (n, 2) [m] on the curtain that are nearest to points (n, 3) [m]."""
        known = places(601, 401).reshape(-1, 2)
        return known[KDTree(self.points(known)).query(points)[1]]


@dataclass(frozen=True)
class Curtain:
    """Wrinkles that wander to and fro, and swell and shrink.

    Attributes:
        begin: phase of the first frame's wrinkles [rad].
    """

    begin: float

    def __call__(self, t: float) -> CurtainState:
        """The curtain at a time [s]."""
        height_m = 0.012 + 0.006 * np.sin(2 * np.pi * 0.8 * t)
        return CurtainState(float(height_m), float(self.begin + 0.8 * np.sin(2 * np.pi * 0.5 * t)))
