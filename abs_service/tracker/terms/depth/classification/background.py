"""Missing returns beside the object: where the background gives no return, a missing return is free space.

A vertex without a measurement is not evidence by itself: the surface may absorb the light. But where the background of
the first image had no return either, a missing return beside the object shows that background, not a hole.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.detection.segments.neighbourhood import grown
from calib.jit import kernel

#: Least number of pixels that a connected area of missing returns shares with the background of the first image to be
#: background; the sensor has lost it if as many of its pixels had a return of the background then.
MIN_PIXELS = 10

#: Missing returns deeper inside the expected outline are a hole all the same: the object does not move as far between
#: two frames [m].
MAX_DEPTH_M = 0.03

#: Width of the zone around the object in which returns are missing in any case, and show no background [px].
MARGIN_PX = 3

#: Largest distance from the mesh of returns that may be the object's: a mesh ends up to a cell inside it [px].
OWN_PX = 16


class Background:
    """Pixels at which the background gives no return, learnt from the first depth image."""

    def __init__(self) -> None:
        self._empty = self._returned = np.zeros((0, 0), np.bool_)
        self._begun = False

    def observe(
        self, missing: NDArray[np.bool_], expected: NDArray[np.bool_], window: Window, shape: tuple[int, ...]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Missing returns (rows, columns) that show the background; those in areas in which it has had some.

        The first call learns.

        Args:
            missing: areas without return (rows, columns) in the window.
            expected: silhouette of the predicted mesh there.
            window: of the image; the first one should be the whole image.
            shape: of the image (height, width).
        """
        if not self._begun:
            self._begun = True
            self._empty, self._returned = np.zeros((2, *shape[:2]), np.bool_)
            self._empty[window] = missing & ~grown(expected, MARGIN_PX)
            self._returned[window] = ~(missing | grown(expected, OWN_PX))
        if not missing.any():
            return missing, missing
        count, labels = cv2.connectedComponents(missing.view(np.uint8), connectivity=4)
        areas = np.asarray(labels, np.int32)
        pixels = FirstPixels(*(np.ascontiguousarray(part[window]) for part in (self._empty, self._returned)))
        found = FirstPixels(np.empty(missing.shape, np.bool_), np.empty(missing.shape, np.bool_))
        _mark_shared(areas, pixels, np.zeros((count, 2), np.int64), found)
        return found.empty, found.returned


class FirstPixels(NamedTuple):
    """Pixels (rows, columns) of the first image without a return and with one, or areas that share enough with them."""

    empty: NDArray[np.bool_]
    returned: NDArray[np.bool_]


@kernel
def _mark_shared(labels: NDArray[np.int32], pixels: FirstPixels, shared: NDArray[np.int64], found: FirstPixels) -> None:
    """Marks the areas that share enough pixels with what the first image showed.

    Args:
        labels: of the areas (rows, columns), 0 for none.
        pixels: those of the first image.
        shared: number of pixels that every area shares with either of them (areas, 2), zeros at the start.
        found: result.
    """
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            label = labels[row, column]
            if label > 0:
                shared[label, 0] += pixels.empty[row, column]
                shared[label, 1] += pixels.returned[row, column]
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            label = labels[row, column]
            found.empty[row, column] = label > 0 and shared[label, 0] >= MIN_PIXELS
            found.returned[row, column] = label > 0 and shared[label, 1] >= MIN_PIXELS
