"""Measurements, one type per kind of sensor: SI values, radial distances, NaN where unknown."""

from collections.abc import Mapping
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


@dataclass(frozen=True, slots=True, eq=False)
class DepthImage:
    """Image of a depth sensor.

    Attributes:
        distance: radial distances (height, width) [m], NaN without return.
        amplitude: amplitudes (height, width) in the sensor's unit, or in their place what the sensor's noise model is
            about: its own deviations [m] (`calib.noise.measured`); NaN where there is none.
    """

    distance: NDArray[np.float32]
    amplitude: NDArray[np.float32]


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
