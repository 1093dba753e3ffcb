"""Classes of the pixels of one depth image, as samples of the mesh read them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.synthesis.window import Placed
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from abs_service.tracker.terms.vertex_counts import VertexMasks
from calib.jit import kernel

#: Bits of the classes: no return where the object should be, of an area or of single pixels; shows an occluder; lies
#: beyond the field of view; left to the outline.
LOST, COVERED, BEYOND, DOUBTFUL = 1, 2, 4, 8

#: Nothing tells how far the object is.
UNKNOWN = LOST | COVERED | DOUBTFUL


@dataclass(frozen=True, slots=True, eq=False)
class PixelClasses:
    """Classes of the pixels of one image (height + 2, width + 2) with a border of one pixel.

    Attributes:
        bits: those of the classes.
        free_m: distance from the object where the sensor looks past it [m], else 0.
    """

    bits: NDArray[np.uint8]
    free_m: NDArray[np.float32]

    def of_samples(self, pixel: NDArray[np.int32], facing: NDArray[np.bool_]) -> tuple[VertexMasks, NDArray[np.bool_]]:
        """Classes of samples (m,), and a mask of those in free space.

        Args:
            pixel: indices into the flattened image, see `Synthesis`; beyond the field of view, samples are outside.
            facing: mask of the samples that are turned towards the sensor.
        """
        free, *masks = np.empty((4, pixel.size), np.bool_)
        found = VertexMasks(np.empty_like(pixel), facing, *masks)
        sort_samples(pixel, self.bits.reshape(-1), self.free_m.reshape(-1), found, free)
        return found, free


@kernel
def sort_samples(
    pixel: NDArray[np.int32],
    bits: NDArray[np.uint8],
    free_m: NDArray[np.float32],
    masks: VertexMasks,
    free: NDArray[np.bool_],
) -> None:
    """Writes what `PixelClasses.of_samples` returns, from classes of all pixels, flattened."""
    for v in range(pixel.size):
        place = np.int32(0) if bits[max(pixel[v], 0)] & BEYOND else pixel[v]
        masks.pixel[v] = place
        own = bits[max(place, 0)]
        masks.missing[v], masks.behind_occluder[v] = own & LOST > 0, own & COVERED > 0
        masks.unjudged[v] = own & DOUBTFUL > 0
        free[v] = place > 0 and free_m[place] > 0


class Masks(NamedTuple):
    """Masks of pixels (rows, columns), see `Visibility`, and of those that are left to the outline."""

    hole: NDArray[np.bool_]
    dropout: NDArray[np.bool_]
    foreground: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    doubtful: NDArray[np.bool_]


class WindowClasses(NamedTuple):
    """Classes of the pixels of a window (rows, columns).

    Attributes:
        bits: those of the classes.
        free_m: distances from the object where the sensor looks past it [m], 0 elsewhere and if left to the outline.
        masked: True behind an occluder, in a hole, or if left to the outline.
    """

    bits: NDArray[np.uint8]
    free_m: NDArray[np.float32]
    masked: NDArray[np.bool_]

    @classmethod
    def of(cls, seen: Visibility, doubtful: NDArray[np.bool_]) -> "WindowClasses":
        """The classes of pixels, of which some are left to the outline."""
        shape, masks = doubtful.shape, Masks(seen.hole, seen.dropout, seen.foreground, seen.beyond, doubtful)
        found = cls(np.empty(shape, np.uint8), np.empty(shape, np.float32), np.empty(shape, np.bool_))
        join_classes(masks, seen.free_m, found)
        return found


class ClassImages:
    """The memory of one sensor's classes, reused between frames."""

    def __init__(self) -> None:
        self._bits, self._free_m = Placed(np.uint8), Placed(np.float32)

    def put(self, found: WindowClasses, window: Window, shape: tuple[int, int]) -> PixelClasses:
        """The classes of an image of a shape (height, width); valid until the next call.

        Args:
            found: those in the window.
            window: of the image; outside it nothing is known of any pixel.
            shape: of the image.
        """
        bits, free_m = self._bits.put(window, found.bits, *shape), self._free_m.put(window, found.free_m, *shape)
        return PixelClasses(bits, free_m)


@kernel
def join_classes(masks: Masks, free_m: NDArray[np.float32], found: WindowClasses) -> None:
    """Writes the classes of pixels (rows, columns), from distances in free space [m]."""
    for row in range(free_m.shape[0]):
        for column in range(free_m.shape[1]):
            at = row, column
            hole, foreground, doubtful = masks.hole[at], masks.foreground[at], masks.doubtful[at]
            lost, beyond = LOST * (hole or masks.dropout[at]), BEYOND * masks.beyond[at]
            found.bits[at] = lost + COVERED * foreground + beyond + DOUBTFUL * doubtful
            found.free_m[at] = np.float32(0) if doubtful else free_m[at]
            found.masked[at] = hole or foreground or doubtful
