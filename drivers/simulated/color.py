"""Colour heads: one that delivers colour, one that delivers the mosaic its sensor measured."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from calib.camera import Camera
from calib.jit import kernel
from drivers.frame import Frame, Kind
from drivers.simulated.body import Appearance
from drivers.simulated.exposure import Exposure, stream_of
from drivers.simulated.scene import Moment, Scene
from drivers.simulated.view import View

#: Standard deviation of a pixel's channel, in levels of 256.
SIGMA = 2.5

#: How much darker a surface is that is seen edge-on than one that faces the camera.
SHADING = 0.2

#: Quantiles of the normal distribution at 65536 equal steps: looking one up takes a fifth of the time of drawing it.
_NORMAL = ndtri((np.arange(2**16) + 0.5) / 2**16).astype(np.float32)


class Picture:
    """The scene in colour, before noise and digits: levels of 256 as float32 (height, width, 3)."""

    def __init__(self, camera: Camera, scene: Scene) -> None:
        self._view = View(scene, camera)
        self._wall = _levels(self._view.wall)

    def take(self, moment: Moment) -> NDArray[np.float32]:
        """Levels at one moment; a pixel at a rim holds the mean of what it sees."""
        levels = self._wall.copy()
        for sight in self._view.look(moment):
            levels[sight.region] += sight.share[..., None] * (_levels(sight) - levels[sight.region])
        return levels


class Color:
    """Stream `color` (rgb8)."""

    def __init__(self, name: str, camera: Camera, scene: Scene, rate_hz: float, sigma: float = SIGMA) -> None:
        self.camera = camera
        self.streams = (stream_of(name, "color", Kind.COLOR, "rgb8", camera, rate_hz),)
        self._sigma = sigma
        self._picture = Picture(camera, scene)

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the colour image of one exposure."""
        levels = self._picture.take(exposure.moment)
        return [exposure.frame(self.streams[0], self.camera, _digitize(levels, self._sigma, exposure.generator))]


class Bayer:
    """Stream `bayer` (bayer_grbg8): of each pixel the one channel that lies behind its colour filter."""

    def __init__(self, name: str, camera: Camera, scene: Scene, rate_hz: float, sigma: float = SIGMA) -> None:
        self.camera = camera
        self.streams = (stream_of(name, "bayer", Kind.BAYER, "bayer_grbg8", camera, rate_hz),)
        self._sigma = sigma
        self._picture = Picture(camera, scene)

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the mosaic of one exposure."""
        levels = _mosaic(self._picture.take(exposure.moment))
        return [exposure.frame(self.streams[0], self.camera, _digitize(levels, self._sigma, exposure.generator))]


def _levels(sight: Appearance) -> NDArray[np.float32]:
    """Colours (height, width, 3) in levels of 256; 0 where the sight is empty."""
    brightness = 255 * (1 - SHADING * (1 - np.nan_to_num(sight.cosine)))
    return (sight.albedo[..., :3] * brightness[..., None]).astype(np.float32, copy=False)


def _mosaic(levels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rows G R G R … and B G B G …."""
    mosaic = levels[..., 1].copy()
    mosaic[0::2, 1::2] = levels[0::2, 1::2, 0]
    mosaic[1::2, 0::2] = levels[1::2, 0::2, 2]
    return mosaic


def _digitize(levels: NDArray[np.float32], sigma: float, generator: np.random.Generator) -> NDArray[np.uint8]:
    """Adds noise and rounds to 8 bits."""
    draws = np.frombuffer(generator.bytes(2 * levels.size), np.uint16)
    return _quantize(levels.reshape(-1), draws, np.float32(sigma) * _NORMAL).reshape(levels.shape)


@kernel
def _quantize(levels: NDArray[np.float32], draws: NDArray[np.uint16], noise: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Rounds levels (n,) plus the noise (65536,) that draws (n,) choose."""
    pixels = np.empty(levels.size, np.uint8)
    for i in range(levels.size):
        value = levels[i] + noise[draws[i]] + np.float32(0.5)
        pixels[i] = np.uint8(min(max(value, np.float32(0)), np.float32(255)))
    return pixels
