"""Classification of the depth images of one sensor, with what its first image tells of missing returns."""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.terms.depth.background import Background, dropouts
from abs_service.tracker.terms.depth.beyond_view import BeyondView
from abs_service.tracker.terms.depth.visibility import Visibility, classify


class Classifier:
    """Knows from the first image where the background gives no return, and where the field of view ends.

    Args:
        focal: focal length of the camera [px].
    """

    def __init__(self, focal: float) -> None:
        self._focal = focal
        self._background, self._beyond_view = Background(), BeyondView()

    def classify(
        self, distance: NDArray[np.float32], expected: NDArray[np.float32], window: Window, shape: tuple[int, ...]
    ) -> Visibility:
        """The classes of the pixels in a window of an image; the first one has to be the whole image.

        Args:
            distance: measured radial distances (rows, columns) [m], NaN without return.
            expected: radial distances of the predicted mesh there [m], infinite beside it.
            window: of the image.
            shape: of the image (height, width).
        """
        missing, silhouette = np.isnan(distance), np.isfinite(expected)
        beyond, single = self._beyond_view.observe(missing, silhouette, window), dropouts(missing)
        empty = self._background.observe(missing & ~(single | beyond), silhouette, window, shape)
        return classify(distance, expected, self._focal, empty, single, beyond)
