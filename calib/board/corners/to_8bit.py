"""Conversion of images of any depth to 8-bit grey levels for OpenCV."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.integer | np.floating]
Grey = NDArray[np.uint8]

#: Percentiles mapped to black and white; excludes dead pixels and lamps.
_BLACK, _WHITE = 0.5, 99.5


def grey(image: Image) -> Grey:
    """Image (height, width) as 8 bits.

    Colour (height, width, 3) becomes the mean of its channels, independent of their order. 8 bits are unchanged. Other
    types are scaled between two percentiles and mapped by a square root, because active illumination falls with the
    square of the distance. NaN becomes black.
    """
    if image.ndim == 3:
        image = cv2.transform(np.ascontiguousarray(image[..., :3]), np.full((1, 3), 1 / 3))
    if image.dtype == np.uint8:
        return np.ascontiguousarray(image, np.uint8)
    values = np.nan_to_num(np.asarray(image, np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    low, high = np.percentile(values, (_BLACK, _WHITE))
    stretched = np.clip((values - low) / max(high - low, 1e-6), 0, 1)
    return np.rint(255 * np.sqrt(stretched)).astype(np.uint8)


def tones(image: Image) -> Iterator[Grey]:
    """Image as 8 bits by all mappings: `grey`, and for other types a linear one, by which markers are found in more."""
    yield (levels := grey(image))
    if image.dtype != np.uint8:
        yield np.rint(np.square(levels / np.float32(255)) * 255).astype(np.uint8)


def local_contrast(levels: Grey) -> Grey:
    """Image with local contrast enhancement (CLAHE), for uneven lighting."""
    return cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8)).apply(levels).astype(np.uint8, copy=False)
