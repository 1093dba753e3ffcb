"""Conversion of images of any depth to 8-bit grey levels of any size for OpenCV."""

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


def scaled(levels: Grey, scale: float) -> Grey:
    """Image that is enlarged, or reduced."""
    if scale == 1:
        return levels
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return cv2.resize(levels, None, fx=scale, fy=scale, interpolation=method).astype(np.uint8, copy=False)


def unscaled(pixels: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """Points of a scaled image in the image itself; both cover one area, and pixel centres are integers in both."""
    return (pixels + 0.5) / scale - 0.5
