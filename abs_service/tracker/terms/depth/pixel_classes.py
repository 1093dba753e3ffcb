"""Classes of the pixels of one depth image, as samples of the mesh read them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.synthesis.window import Placed
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from calib.jit import kernel

#: Bits of the classes: no return where the object should be, of an area or of single pixels; shows an occluder; lies
#: beyond the field of view; left to the outline.
LOST, COVERED, BEYOND, DOUBTFUL = 1, 2, 4, 8

#: Nothing tells how far the object is.
UNKNOWN = LOST | COVERED | DOUBTFUL


@dataclass(frozen=True, slots=True, eq=False)
class PixelClasses:
    """Classes of the pixels of one image (height + 2, width + 2) with a border of one pixel, or of samples (m,).

    Attributes:
        bits: those of the classes.
        free_m: distance from the object where the sensor looks past it [m], else 0.
    """

    bits: NDArray[np.uint8]
    free_m: NDArray[np.float32]

    def at(self, pixel: NDArray[np.integer]) -> "PixelClasses":
        """Classes of samples at indices (m,) into the flattened image, see `Synthesis`."""
        return PixelClasses(self.bits.take(pixel), self.free_m.take(pixel))

    def has(self, bit: int) -> NDArray[np.bool_]:
        """True for those of a class."""
        return (self.bits & bit) > 0


class Masks(NamedTuple):
    """Masks of pixels (rows, columns), see `Visibility`, and of those that are left to the outline."""

    hole: NDArray[np.bool_]
    dropout: NDArray[np.bool_]
    foreground: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    doubtful: NDArray[np.bool_]


class ClassImages:
    """The memory of one sensor's classes, reused between frames."""

    def __init__(self) -> None:
        self._bits, self._free_m = Placed(np.uint8), Placed(np.float32)

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
        bits = np.empty(doubtful.shape, np.uint8)
        masks = Masks(seen.hole, seen.dropout, seen.foreground, seen.beyond, doubtful)
        join_classes(masks, bits)
        return PixelClasses(self._bits.put(window, bits, *shape), self._free_m.put(window, free_m, *shape))


@kernel
def join_classes(masks: Masks, bits: NDArray[np.uint8]) -> None:
    """Writes the bits of pixels (rows, columns)."""
    for row in range(bits.shape[0]):
        for column in range(bits.shape[1]):
            at = row, column
            is_lost = masks.hole[at] or masks.dropout[at]
            covered, beyond = COVERED * masks.foreground[at], BEYOND * masks.beyond[at]
            bits[at] = LOST * is_lost + covered + beyond + DOUBTFUL * masks.doubtful[at]
