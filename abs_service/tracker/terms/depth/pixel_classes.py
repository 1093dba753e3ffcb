"""Classes of the pixels of one depth image, as samples of the mesh read them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.synthesis.window import Placed
from abs_service.tracker.terms.depth.classification.visibility import Visibility


@dataclass(frozen=True, slots=True, eq=False)
class PixelClasses:
    """Classes of the pixels of one image (height + 2, width + 2) with a border of one pixel, or of samples (m,).

    Attributes:
        lost: no return where the object should be, of an area or of single pixels.
        covered: shows an occluder.
        beyond: lies beyond the field of view.
        doubtful: left to the outline.
        free_m: distance from the object where the sensor looks past it [m], else 0.
    """

    lost: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    doubtful: NDArray[np.bool_]
    free_m: NDArray[np.float32]

    def at(self, pixel: NDArray[np.integer]) -> "PixelClasses":
        """Classes of samples at indices (m,) into the flattened image, see `Synthesis`."""
        lost, covered, beyond, doubtful = (
            image.take(pixel) for image in (self.lost, self.covered, self.beyond, self.doubtful)
        )
        return PixelClasses(lost, covered, beyond, doubtful, self.free_m.take(pixel))

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """True where nothing tells how far the object is."""
        return self.lost | self.covered | self.doubtful


class ClassImages:
    """The memory of one sensor's classes, reused between frames."""

    def __init__(self) -> None:
        self._lost, self._covered, self._beyond, self._doubtful = (Placed(np.bool_) for _ in range(4))
        self._free_m = Placed(np.float32)

    def put(
        self,
        seen: Visibility,
        doubtful: NDArray[np.bool_],
        free_m: NDArray[np.float32],
        window: Window,
        shape: tuple[int, int],
    ) -> PixelClasses:
        """The classes of an image of a shape (height, width); valid until the next call.

        Args:
            seen: classes of the pixels (rows, columns) in the window.
            doubtful: those that are left to the outline.
            free_m: distances from the object [m] of the others.
            window: of the image; outside it nothing is known of any pixel.
            shape: of the image.
        """
        return PixelClasses(
            self._lost.put(window, seen.hole | seen.dropout, *shape),
            self._covered.put(window, seen.foreground, *shape),
            self._beyond.put(window, seen.beyond, *shape),
            self._doubtful.put(window, doubtful, *shape),
            self._free_m.put(window, free_m, *shape),
        )
