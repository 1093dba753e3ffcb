"""Images of any depth as grey levels of 8 bits, which is what OpenCV finds boards in."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.integer | np.floating]
Grey = NDArray[np.uint8]

#: What becomes black and white, in percent of the pixels: a few of them are dead, or a lamp.
_BLACK, _WHITE = 0.5, 99.5


def grey(image: Image) -> Grey:
    """The image (height, width) as 8 bits.

    Colour (height, width, 3) becomes the mean of its channels, so that red, green, blue and blue, green, red are the
    same. 8 bits stay as they are. Numbers of any other type are the square root of what they are between two
    percentiles: light that a sensor sends out itself falls with the square of the distance. NaN is black.
    """
    if image.ndim == 3:
        image = cv2.transform(np.ascontiguousarray(image[..., :3]), np.full((1, 3), 1 / 3))
    if image.dtype == np.uint8:
        return np.ascontiguousarray(image, np.uint8)
    values = np.nan_to_num(np.asarray(image, np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    low, high = np.percentile(values, (_BLACK, _WHITE))
    stretched = np.clip((values - low) / max(high - low, 1e-6), 0, 1)
    return np.rint(255 * np.sqrt(stretched)).astype(np.uint8)


def local_contrast(levels: Grey) -> Grey:
    """The same with the contrast of each region stretched, for boards that are lit unevenly."""
    return cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8)).apply(levels).astype(np.uint8, copy=False)
