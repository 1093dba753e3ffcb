"""Place of the object in the first frame: pixels that are given with it, or else a region."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.regions.base import Region
from abs_service.tracker.detection.regions.mask import Mask


class RegionOrMask:
    """The pixels of a mask while there is one, else of the region. It is its own settings.

    Attributes:
        mask: pixels of the object (height, width); None: the region counts.
    """

    def __init__(self, region: Region):
        self.mask: NDArray[np.bool_] | None = None
        self._region = region

    def build(self) -> Region:
        """Returns this region: it needs no building."""
        return self

    def select(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels of the object (height, width)."""
        region = self._region if self.mask is None else Mask(self.mask)
        return region.select(view)
