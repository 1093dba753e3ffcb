"""Colour head with raw Bayer images: each pixel has the channel of its own filter."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.contract.frame import Frame, Kind
from drivers.simulated.sensors.color import SIGMA, Picture, digitize
from drivers.simulated.sensors.exposure import Exposure, stream_of

#: Bayer patterns: first row left and right, second row left and right.
ORDERS = ("rggb", "bggr", "grbg", "gbrg")


@dataclass(frozen=True)
class Mosaic:
    """Image formation on the Bayer sensor.

    Attributes:
        order: filter pattern, one of `ORDERS`.
        crosstalk: fraction c of a pixel's light that is measured by its four neighbours, a quarter each. In smooth
            areas, red pixels then read (1 − c) R + c G, blue ones alike, and green ones (1 − c) G + c (R + B) / 2.
    """

    order: str = "grbg"
    crosstalk: float = 0.0

    def expose(self, levels: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mosaic (height, width) of a colour image (height, width, 3)."""
        mosaic = np.empty(levels.shape[:2], np.float32)
        for place, letter in enumerate(self.order):
            row, column = divmod(place, 2)
            mosaic[row::2, column::2] = levels[row::2, column::2, "rgb".index(letter)]
        return self._leak(mosaic) if self.crosstalk > 0 else mosaic

    def _leak(self, mosaic: NDArray[np.float32]) -> NDArray[np.float32]:
        framed = np.pad(mosaic, 1, mode="reflect")  # reflection continues the filter pattern across the border
        around = framed[:-2, 1:-1] + framed[2:, 1:-1] + framed[1:-1, :-2] + framed[1:-1, 2:]
        return ((1 - self.crosstalk) * mosaic + 0.25 * self.crosstalk * around).astype(np.float32)


class Bayer:
    """Stream `bayer` (bayer_<order>8)."""

    def __init__(
        self, name: str, picture: Picture, rate_hz: float, sigma: float = SIGMA, mosaic: Mosaic = Mosaic()
    ) -> None:
        self.camera = picture.camera
        self.streams = (stream_of(name, "bayer", Kind.BAYER, f"bayer_{mosaic.order}8", picture.camera, rate_hz),)
        self._picture = picture
        self._sigma = sigma
        self._mosaic = mosaic

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the mosaic of one exposure."""
        data = digitize(self._mosaic.expose(self._picture.take(exposure.moment)), self._sigma, exposure)
        return [exposure.frame(self.streams[0], self.camera, data, exposure_s=exposure.color_s)]
