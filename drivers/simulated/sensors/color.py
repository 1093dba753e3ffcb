"""Colour rendering of the scene, and a colour head."""

from dataclasses import replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from calib.camera import Camera
from calib.jit import kernel
from drivers.contract.frame import Frame, Kind
from drivers.simulated.scene.body import RayImage
from drivers.simulated.scene.scene import Moment, Scene
from drivers.simulated.sensors.exposure import Exposure, stream_of
from drivers.simulated.sensors.view import View

#: Standard deviation of a pixel's channel, in levels of 256.
SIGMA = 2.5

#: Relative darkening of a surface seen edge-on, compared with one that faces the camera.
SHADING = 0.2

#: Quantiles of the normal distribution at 65536 equal steps: a table lookup takes a fifth of the time of a normal draw.
_NORMAL = ndtri((np.arange(2**16) + 0.5) / 2**16).astype(np.float32)


class Picture:
    """Colour rendering of the scene, before noise and quantisation.

    Args:
        camera: the camera.
        scene: the scene.
        samples: rays per pixel and axis (supersampling); one, through the centre, is enough
            unless the texture has details of the size of a pixel.
        blur_px: blur of the lens: standard deviation of its Gaussian point spread function.
    """

    def __init__(self, camera: Camera, scene: Scene, samples: int = 1, blur_px: float = 0.0) -> None:
        self.camera = camera
        self._samples = samples
        self._blur_px = blur_px
        self._view = View(scene, _finer(camera, samples))

    @cached_property
    def _wall(self) -> NDArray[np.float32]:
        return _levels(self._view.wall)

    def take(self, moment: Moment) -> NDArray[np.float32]:
        """Image (height, width, 3) in levels of 256 at one moment, antialiased at rims, blurred by the lens."""
        levels = self._wall.copy()
        for sight in self._view.look(moment):
            levels[sight.region] += sight.share[..., None] * (_levels(sight) - levels[sight.region])
        if self._samples > 1:  # for integer factors this is the mean, ten times as fast as NumPy's
            size = (self.camera.width, self.camera.height)
            levels = cv2.resize(levels, size, interpolation=cv2.INTER_AREA)
        if self._blur_px > 0:
            levels = cv2.GaussianBlur(levels, (0, 0), self._blur_px, borderType=cv2.BORDER_REPLICATE)
        return levels.astype(np.float32, copy=False)


class Color:
    """Stream `color` (rgb8)."""

    def __init__(self, name: str, picture: Picture, rate_hz: float, sigma: float = SIGMA) -> None:
        self.camera = picture.camera
        self.streams = (stream_of(name, "color", Kind.COLOR, "rgb8", picture.camera, rate_hz),)
        self._picture = picture
        self._sigma = sigma

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the colour image of one exposure."""
        data = digitize(self._picture.take(exposure.moment), self._sigma, exposure)
        return [exposure.frame(self.streams[0], self.camera, data, exposure_s=exposure.color_s)]


def digitize(levels: NDArray[np.float32], sigma: float, exposure: Exposure) -> NDArray[np.uint8]:
    """Exposes levels of 256, adds noise of deviation `sigma` and rounds to 8 bits."""
    # Same result as `generator.bytes`, in a quarter of the time.
    words = exposure.generator.integers(0, 2**64, size=-(-levels.size // 4), dtype=np.uint64)
    draws = words.astype("<u8", copy=False).view("<u2")[: levels.size]
    noise, brightness = np.float32(sigma) * _NORMAL, np.float32(exposure.brightness)
    return _quantize(levels.reshape(-1), draws, noise, brightness).reshape(levels.shape)


def _finer(camera: Camera, samples: int) -> Camera:
    """The camera with each pixel divided into `samples` × `samples`."""
    return replace(
        camera,
        width=samples * camera.width,
        height=samples * camera.height,
        fx=samples * camera.fx,
        fy=samples * camera.fy,
        cx=samples * (camera.cx + 0.5) - 0.5,
        cy=samples * (camera.cy + 0.5) - 0.5,
    )


def _levels(seen: RayImage) -> NDArray[np.float32]:
    """Colours (height, width, 3) in levels of 256; 0 for a miss."""
    brightness = 255 * (1 - SHADING * (1 - np.nan_to_num(seen.cosine)))
    return (seen.albedo[..., :3] * brightness[..., None]).astype(np.float32, copy=False)


@kernel
def _quantize(
    levels: NDArray[np.float32], draws: NDArray[np.uint16], noise: NDArray[np.float32], brightness: np.float32
) -> NDArray[np.uint8]:
    """Rounds levels (n,) times the brightness plus noise (65536,) indexed by draws (n,)."""
    pixels = np.empty(levels.size, np.uint8)
    for i in range(levels.size):
        value = brightness * levels[i] + noise[draws[i]] + np.float32(0.5)
        pixels[i] = np.uint8(min(max(value, np.float32(0)), np.float32(255)))
    return pixels
