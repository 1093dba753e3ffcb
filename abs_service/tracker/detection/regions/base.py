"""Interface of regions."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Region(Protocol):
    """Selects the object's pixels in the first depth image."""

    def select(self, points_r: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Pixels (height, width) of the object.

        Args:
            points_r: rig coordinates of every pixel (height, width, 3) [m], NaN without return.
            distance: radial distances (height, width) [m], NaN without return.

        Raises:
            DetectionError: there is no object.
        """
        ...
