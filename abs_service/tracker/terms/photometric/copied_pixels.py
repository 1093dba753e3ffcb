"""Colours of an image where the samples of a mesh read them: a hundredth of the window around the object."""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Limits, Window, limits
from abs_service.tracker.synthesis.window import NOTHING_HAS, Bordered
from calib.jit import kernel

Picture = NDArray[np.float32] | NDArray[np.uint8]

_NO_MASK = np.zeros((0, 0), np.bool_)


class CopiedPixels:
    """A colour image with a border of one pixel; NaN, as in the border, means no measurement, and infinity an occluder.

    Pixels are copied when they are read. To copy the whole window takes longer than to compare a mesh with it, since
    neither image nor copy are in the processor's cache.
    """

    def __init__(self) -> None:
        self._bordered = Bordered(np.full(3, np.nan, np.float32), np.full(3, NOTHING_HAS, np.float32))
        self._texture = np.zeros((2, 2, 3), np.float32)
        self._picture: Picture = np.zeros((0, 0, 3), np.uint8)
        self._covered, self._limits, self._is_complete, self._left = _NO_MASK, (0, 0, 0, 0), False, 0
        self._copied: list[NDArray[np.int32]] = []  # pixels of single candidates, which are read again and again

    def observe(self, picture: Picture, window: Window) -> None:
        """Sets the image (height, width, 3), contiguous, of which a window may show the object."""
        self._texture, self._picture = self._bordered.move(picture.shape[:2], window), picture
        self._limits = limits(window, picture.shape)
        self.cover(_NO_MASK)

    def cover(self, covered: NDArray[np.bool_]) -> None:
        """Sets the pixels (height, width) that show an occluder; an empty mask: none."""
        (top, bottom, left, right), self._covered = self._limits, covered
        self._is_complete, self._left, self._copied = False, (bottom - top) * (right - left), []

    def at(self, pixel: NDArray[np.int32]) -> NDArray[np.float32]:
        """The image (pixels, 3), complete at the pixels of samples (population, m), see `Synthesis`."""
        if not (self._is_complete or any(pixel is one for one in self._copied)):
            self._copy(pixel)
        return self._texture.reshape(-1, 3)

    def _copy(self, pixel: NDArray[np.int32]) -> None:
        """Copies these pixels, or the window if it has fewer than they and those before."""
        top, bottom, left, right = self._limits
        self._left -= pixel.size
        if self._left > 0:
            copy_pixels(pixel.ravel(), self._picture, self._covered, self._limits, self._texture)
            self._copied += [pixel] if len(pixel) == 1 else []
            return
        window = slice(top, bottom), slice(left, right)
        self._bordered.inside[:] = self._picture[window]
        if self._covered.size:
            self._bordered.inside[self._covered[window]] = np.inf
        self._is_complete = True


@kernel
def copy_pixels(
    pixels: NDArray[np.int32],
    picture: Picture,
    covered: NDArray[np.bool_],
    window: Limits,
    texture: NDArray[np.float32],
) -> None:
    """Copies pixels within a window, infinities where they are covered.

    Args:
        pixels: indices (m,) into the flattened texture.
        picture: the image (height, width, 3).
        covered: its pixels with an occluder (height, width); empty without any.
        window: first row, end of the rows, first column, end of the columns.
        texture: the image with a border (height + 2, width + 2, 3).
    """
    (top, bottom, left, right), stride = window, np.uint32(texture.shape[1])
    for m in range(pixels.size):
        pixel = np.uint32(max(pixels[m], 0))  # a division of short numbers takes a third of the time
        row, column = int(pixel // stride) - 1, int(pixel % stride) - 1
        if row >= top and row < bottom and column >= left and column < right:
            is_covered = covered.size > 0 and covered[row, column]
            for c in range(3):
                texture[row + 1, column + 1, c] = np.inf if is_covered else picture[row, column, c]
