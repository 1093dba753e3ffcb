"""Noise model of a part of a sensor's image, from one with numbers of its own for every pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, Pixels


@dataclass(frozen=True)
class PartOfImage:
    """The model of the whole image at other rows and columns.

    Attributes:
        whole: the model of the sensor.
        top, left: row and column of the part's first pixel.
    """

    whole: DepthNoise
    top: int
    left: int

    @property
    def uses_amplitude(self) -> bool:
        """That of the model of the whole image."""
        return self.whole.uses_amplitude

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset, see `DepthNoise`; rows and columns `p` are in the part."""
        return self.whole.mean(x, a, self._in_whole(p))

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation, see `DepthNoise`; rows and columns `p` are in the part."""
        return self.whole.deviation(x, a, self._in_whole(p))

    def _in_whole(self, p: Pixels) -> Pixels:
        return p[0] + self.top, p[1] + self.left
