"""Input of a calibration: observations of a board by the sensors of a rig.

The frame b of a board has its origin in the centre of the board's first corner, x along the first row of corners, y
along the first column, z into the board (away from a camera that sees its printed side), so that `T_rb` of a board in
front of an unrotated camera is close to a translation along +z.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class CornerView:
    """Corners of a board in one image.

    Attributes:
        sensor: optical head that took the image. The amplitudes of a depth sensor are an image of that sensor.
        shot: number of the moment; views with the same number show the board in the same place.
        t_s: time of the exposure [s]; only differences count, and only between sensors that run freely.
        points_b: corners in the board's frame, shape (n, 3) [m].
        pixels: where the image shows them, shape (n, 2) [px]; centres of pixels are integers.
        sigma_px: standard deviation of one coordinate [px].
    """

    sensor: str
    shot: int
    t_s: float
    points_b: NDArray[np.float64]
    pixels: NDArray[np.float64]
    sigma_px: float = 0.1

    @property
    def digest(self) -> str:
        """Digest of the corners, rounded to 1e-3 px: images that are the same have the same, and no others."""
        return hashlib.sha256(np.round(self.pixels, 3).tobytes()).hexdigest()[:16]

    def renamed(self, to: Mapping[str, str]) -> "CornerView":
        """View of the sensor that this one's images belong to; of a sensor that is not named, as it is."""
        return replace(self, sensor=to.get(self.sensor, self.sensor))


@dataclass(frozen=True, slots=True, eq=False)
class PlaneView:
    """Distances that a depth sensor measured on the plane z = 0 of a board.

    Attributes:
        sensor, shot, t_s: as of a `CornerView`.
        pixels: where, shape (n, 2) [px].
        distances: radial distances, from the camera centre, shape (n,) [m].
        sigmas: their standard deviations, shape (n,) [m].
    """

    sensor: str
    shot: int
    t_s: float
    pixels: NDArray[np.float64]
    distances: NDArray[np.float64]
    sigmas: NDArray[np.float64]
