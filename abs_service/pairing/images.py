"""Measurements, one type per kind of sensor: SI values, radial distances, NaN where unknown."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Shares of red, green and blue in grey (ITU-R BT.601).
LUMA = np.array([0.299, 0.587, 0.114], np.float32)

#: Channel pattern of a single-channel image, and those of the Bayer mosaics by name.
ONE_CHANNEL = np.zeros((1, 1), np.uint8)
BAYER_ORDERS: Mapping[str, NDArray[np.uint8]] = {
    order: np.array(["rgb".index(letter) for letter in order], np.uint8).reshape(2, 2)
    for order in ("rggb", "bggr", "grbg", "gbrg")
}


#: Rows and columns of an image, and what an image holds there: distances and amplitudes.
Window = tuple[slice, slice]
Parts = tuple[NDArray[np.float32], NDArray[np.float32]]

#: First row, end row, first column and end column of a window.
Limits = tuple[int, int, int, int]


class DepthImage:
    """Image of a depth sensor.

    A tracked object fills a part of an image, and only that part is converted from what the sensor delivered.

    Args:
        distance: radial distances (height, width) [m], NaN without return.
        amplitude: amplitudes (height, width) in the sensor's unit, or in their place what the sensor's noise model is
            about: its own deviations [m] (`calib.noise.measured`); NaN where there is none.
    """

    def __init__(self, distance: NDArray[np.float32], amplitude: NDArray[np.float32]):
        self.shape: tuple[int, ...] = distance.shape
        self._convert: Callable[[Window], Parts] = lambda window: (distance[window], amplitude[window])
        self._last: tuple[Limits, Parts] = ((0, len(distance), 0, distance.shape[1]), (distance, amplitude))

    @classmethod
    def deferred(cls, shape: tuple[int, int], convert: Callable[[Window], Parts]) -> "DepthImage":
        """An image of a shape (height, width) that `convert` makes window by window, when it is wanted."""
        empty = np.zeros((0, 0), np.float32)
        image = cls(empty, empty)
        image.shape, image._convert, image._last = shape, convert, ((0, 0, 0, 0), (empty, empty))
        return image

    @property
    def distance(self) -> NDArray[np.float32]:
        """Radial distances of the whole image, see the class."""
        return self.within((slice(None), slice(None)))[0]

    @property
    def amplitude(self) -> NDArray[np.float32]:
        """Amplitudes of the whole image, see the class."""
        return self.within((slice(None), slice(None)))[1]

    def within(self, window: Window) -> Parts:
        """Distances and amplitudes (rows, columns) in a window; parts of the last one are converted only once."""
        top, bottom, left, right = limits(window, self.shape)
        (first, last, begin, end), parts = self._last
        if not (first <= top and bottom <= last and begin <= left and right <= end):
            first, begin, parts = top, left, self._convert(window)
            self._last = ((top, bottom, left, right), parts)
        inside = slice(top - first, bottom - first), slice(left - begin, right - begin)
        return parts[0][inside], parts[1][inside]


def limits(window: Window, shape: tuple[int, ...]) -> Limits:
    """Limits of a window in an image of a shape."""
    (top, bottom, _), (left, right, _) = window[0].indices(shape[0]), window[1].indices(shape[1])
    return top, bottom, left, right


@dataclass(frozen=True, slots=True, eq=False)
class ColorImage:
    """Image of a colour sensor: red, green, blue (height, width, 3) in 0…255."""

    rgb: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class ChannelImage:
    """Image of a sensor with one value per pixel.

    Attributes:
        values: (height, width), NaN where nothing was measured; grey and colour filters in 0…255, others in the
            sensor's unit.
        channels: of the surface's colours (red, green, blue: 0, 1, 2), the one that a pixel shows, (rows, columns) of
            the pattern that repeats from the upper left corner on; [[0]] if there is only one.
    """

    values: NDArray[np.float32]
    channels: NDArray[np.uint8]

    @property
    def channel(self) -> NDArray[np.uint8]:
        """The channel of every pixel (height, width)."""
        repeats = [-(-size // period) for size, period in zip(self.values.shape, self.channels.shape)]
        return np.tile(self.channels, repeats)[: self.values.shape[0], : self.values.shape[1]]


@dataclass(frozen=True, slots=True)
class BeamReading:
    """Measurement of a light barrier."""

    interrupted: bool


Image = DepthImage | ColorImage | ChannelImage | BeamReading
