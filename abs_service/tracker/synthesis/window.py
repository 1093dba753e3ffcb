"""Window of a camera's image that can contain the object; only its pixels are prepared for a frame."""

import math
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Limits, Window, limits
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.projection import Projection, extent
from calib.camera import Camera
from calib.jit import kernel

Number = TypeVar("Number", bound=np.generic)

WHOLE: Window = (slice(None), slice(None))

#: Value that no image contains; pixels outside the window are set to it, so that every candidate is an outlier there.
NOTHING_HAS = 1e6


def around(camera: Camera, projection: Projection, predicted: Surface, reach_m: float) -> Window:
    """Rows and columns that can contain a surface; the first ones are even, for images of half the size.

    At least one of each: of a surface beside the image, those at the image's edge.

    Args:
        camera: the camera.
        projection: of the same camera.
        predicted: predicted surface, a population of one.
        reach_m: largest distance of the surface from the prediction [m]; infinite: the whole image.
    """
    seen = projection.project(predicted.vertices)
    nearest = seen.inverse_z.max(initial=0.0)
    if not np.isfinite(reach_m * nearest):
        return WHOLE
    margin, (low, high) = reach_m * max(camera.fx, camera.fy) * nearest + 2, extent(seen)
    (top, left), (bottom, right) = (low - margin).tolist(), (high + margin).tolist()
    return _between(top, bottom, camera.height), _between(left, right, camera.width)


def _between(first: float, last: float, size: int) -> slice:
    """Rows or columns from one to another, of as many as the image has."""
    begin = int(min(max(first, 0), size - 1)) // 2 * 2
    return slice(begin, math.ceil(min(max(last, begin), size - 1)) + 1)


def corner(window: Window) -> tuple[int, int]:
    """Row and column of a window's first pixel."""
    return window[0].start or 0, window[1].start or 0


def within(image: NDArray[Number], window: Window) -> NDArray[Number]:
    """A view of a window's pixels in an image with a border of one pixel."""
    return image[1:-1, 1:-1][window]


class Bordered:
    """An image with a border of one pixel that is filled within a window; its memory is reused between frames.

    Allocating memory takes as long as filling it.

    Args:
        border: value of the border (channels,).
        beyond: value of the image outside the window (channels,).
    """

    def __init__(self, border: NDArray[np.float32], beyond: NDArray[np.float32]):
        self.border = border
        self.beyond = beyond
        self._image = np.zeros((0, 0, len(border)), np.float32)
        self.window = WHOLE

    @property
    def inside(self) -> NDArray[np.float32]:
        """A view of the window's pixels (rows, columns, channels)."""
        return within(self._image, self.window)

    def begin(self, shape: tuple[int, ...], window: Window) -> NDArray[np.float32]:
        """The image (height + 2, width + 2, channels) of a shape (height, width), its window filled with `border`."""
        image = self.move(shape, window)
        _fill(image, *limits(window, shape), self.border)
        return image

    def move(self, shape: tuple[int, ...], window: Window) -> NDArray[np.float32]:
        """The same with anything in its window, for those who fill it."""
        height, width = shape
        if self._image.shape[:2] != (height + 2, width + 2):
            self._image = np.empty((height + 2, width + 2, len(self.border)), np.float32)
            self._image[:] = self.border
            self.window = WHOLE
        for left_over in _without(limits(self.window, shape), limits(window, shape)):
            _fill(self._image, *left_over, self.beyond)
        self.window = window
        return self._image


class Placed(Generic[Number]):
    """An image with a border that holds a window's values, zeros elsewhere; its memory is reused between frames."""

    def __init__(self, dtype: type[Number]):
        self._image: NDArray[Number] = np.zeros((0, 0), dtype)
        self._window = WHOLE

    def put(self, window: Window, values: NDArray[Number], height: int, width: int) -> NDArray[Number]:
        """The image (height + 2, width + 2) with other values; valid until the next call."""
        if self._image.shape != (height + 2, width + 2):
            self._image = np.zeros((height + 2, width + 2), self._image.dtype)
        for top, bottom, left, right in _without(*(limits(one, (height, width)) for one in (self._window, window))):
            within(self._image, (slice(top, bottom), slice(left, right)))[:] = 0
        within(self._image, window)[:] = values
        self._window = window
        return self._image


def _without(old: Limits, new: Limits) -> list[Limits]:
    """Rectangles that cover one without another."""
    top, bottom, left, right = old
    first, last = max(top, new[0]), min(bottom, new[1])
    parts = [
        (top, min(bottom, new[0]), left, right),
        (max(top, new[1]), bottom, left, right),
        (first, last, left, min(right, new[2])),
        (first, last, max(left, new[3]), right),
    ]
    return [part for part in parts if part[0] < part[1] and part[2] < part[3]]


@kernel
def _fill(image: NDArray[np.float32], top: int, bottom: int, left: int, right: int, value: NDArray[np.float32]) -> None:
    """Writes a value (channels,) into rows and columns of an image; their indices exclude its border."""
    for row in range(top + 1, bottom + 1):
        for column in range(left + 1, right + 1):
            for channel in range(value.size):
                image[row, column, channel] = value[channel]
