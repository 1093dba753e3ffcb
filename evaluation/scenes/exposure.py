"""One exposure of a sequence, with the true surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.contract.frame import FrameSet


@dataclass(frozen=True, eq=False)
class LabeledExposure:
    """Frames of all heads at one time, with the true material points of the surface.

    Attributes:
        frames: of all heads.
        points: true positions of the material points (rows, columns, 3) [m].
    """

    frames: FrameSet
    points: NDArray[np.float64]
