"""Interface of regions."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView


class Region(Protocol):
    """Selects the object's pixels in the first depth image."""

    def select(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the object; all of them have a return.

        Raises:
            DetectionError: there is no object.
        """
        ...
