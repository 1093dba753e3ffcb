"""Red, green and blue of every pixel of a Bayer mosaic: for a surface's appearance, never to compare it with."""

import cv2
import numpy as np
from numpy.typing import NDArray

RED, GREEN, BLUE = range(3)

# Gains of Malvar, He and Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images",
# ICASSP 2004: a missing channel is interpolated among its own pixels and corrected by the Laplacian of the channel that
# the pixel has, since details of brightness are alike in all channels.
_GREEN = np.array([[0, 0, -2, 0, 0], [0, 0, 4, 0, 0], [-2, 4, 8, 4, -2], [0, 0, 4, 0, 0], [0, 0, -2, 0, 0]])
_BESIDE = np.array([[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]])
_ACROSS = np.array([[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]])


def demosaiced(values: NDArray[np.float32], channel: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Colours (height, width, 3) in 0…255.

    Args:
        values: mosaic (height, width), 0…255.
        channel: 0 (red), 1 (green) or 2 (blue) of every pixel (height, width).
    """
    green, beside, above, across = (_filtered(values, gains) for gains in (_GREEN, _BESIDE, _BESIDE.T, _ACROSS))
    red_row = np.any(channel == RED, axis=1)[:, None]
    of_red = np.where(channel == GREEN, np.where(red_row, beside, above), across)
    of_blue = np.where(channel == GREEN, np.where(red_row, above, beside), across)
    planes = (of_red, green, of_blue)
    colors = np.stack([np.where(channel == own, values, plane) for own, plane in enumerate(planes)], axis=-1)
    return np.clip(colors, 0, 255).astype(np.float32)


def _filtered(values: NDArray[np.float32], gains: NDArray[np.integer]) -> NDArray[np.float32]:
    """Filtered mosaic; it is mirrored in its outermost pixels, so that the colours go on alternating beyond them."""
    return np.asarray(cv2.filter2D(values, -1, gains / 16, borderType=cv2.BORDER_REFLECT_101), np.float32)
