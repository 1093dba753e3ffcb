"""Textures: colour and infra-red reflectivity over material coordinates."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from drivers.simulated.scene.raycast import lookup

Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Texture:
    """Reflectivities on a regular grid, centred on a rectangle.

    Attributes:
        texels: (rows, columns, 4): red, green, blue and infra-red reflectivity, 0 to 1.
        density: texels per metre.
    """

    texels: NDArray[np.float32]
    density: float

    def at(self, a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
        """Reflectivities (height, width, 4) at material coordinates (height, width) [m]; zero where they are NaN."""
        rows, columns = self.texels.shape[:2]
        density = np.float32(self.density)
        return lookup(
            self.texels, a * density + np.float32((columns - 1) / 2), b * density + np.float32((rows - 1) / 2)
        )


@lru_cache(maxsize=32)  # of 2 MB or less; filtering them takes most of the time in which a simulation starts
def smooth_pattern(
    seed: int,
    width: float,
    height: float,
    scales: tuple[float, ...],
    density: float,
    color: Range,
    infrared: Range,
) -> Texture:
    """Random pattern without edges: smoothed noise at several scales, independent in every channel.

    Args:
        seed: random seed.
        width, height: of the rectangle [m].
        scales: σ of the smoothing Gaussians [m]; each has half the weight of the previous one.
        density: texels per metre.
        color, infrared: minimum and maximum reflectivity of red, green and blue, and of infra-red.
    """
    shape = (round(height * density) + 1, round(width * density) + 1)
    generator = np.random.default_rng([seed, 3])
    texels = np.empty((*shape, 4), np.float32)
    for channel, (low, high) in enumerate((color, color, color, infrared)):
        pattern = np.zeros(shape, np.float32)
        for i, scale in enumerate(scales):
            noise = gaussian_filter(generator.standard_normal(shape, np.float32), scale * density, mode="wrap")
            pattern += 0.5**i * noise / noise.std()
        texels[..., channel] = low + (high - low) * (0.5 + 0.5 * np.tanh(pattern))
    return Texture(texels, density)


@lru_cache(maxsize=4)  # of 6 MB
def fine_pattern(
    seed: int, width: float, height: float, color: Range, infrared: Range, density: float = 2500.0
) -> Texture:
    """Fine print with details of the size of a pixel; like most prints it varies more in brightness than in hue.

    Noise smoothed by σ alternates between dark and bright every 4.4 σ on average, so the two finest scales do so every
    4.4 and 2.2 mm. For comparison, an image of 640 px with the simulated colour head's field of view has one pixel per
    1.8 mm at a distance of 1 m. Two thirds of a channel's variance are common to all channels, which demosaicing relies
    on.

    Args:
        seed: random seed.
        width, height: of the rectangle [m].
        color, infrared: minimum and maximum reflectivity of red, green and blue, and of infra-red.
        density: texels per metre.
    """
    shape = (round(height * density) + 1, round(width * density) + 1)
    generator = np.random.default_rng([seed, 3])
    planes = np.zeros((5, *shape), np.float32)  # common to all channels, and one per channel
    for scale, part in ((0.001, 1.0), (0.0005, 0.7), (0.01, 0.7)):
        for i in range(len(planes)):
            noise = gaussian_filter(generator.standard_normal(shape, np.float32), scale * density, mode="wrap")
            planes[i] += part * noise / noise.std()
    patterns = np.tanh(np.sqrt(2 / 3) * planes[0] + np.sqrt(1 / 3) * planes[1:])
    low, high = np.array([color, color, color, infrared], np.float32).T[:, :, None, None]
    texels = np.moveaxis(low + (high - low) * (0.5 + 0.5 * patterns), 0, -1)
    return Texture(np.ascontiguousarray(texels), density)


#: Paper, and the inks of `printed_paper`: red, green, blue and infra-red reflectivity, in which most inks are bright.
_PAPER = (0.88, 0.86, 0.81, 0.85)
_INKS = ((0.12, 0.16, 0.30, 0.40), (0.72, 0.20, 0.16, 0.75), (0.10, 0.45, 0.42, 0.55), (0.90, 0.62, 0.15, 0.80))


@lru_cache(maxsize=4)  # of 2 MB
def printed_paper(seed: int, width: float, height: float, density: float = 1600.0) -> Texture:
    """White paper with fibres, printed with dots of 6 to 22 mm in four inks, as wrapping paper or a cloth may be.

    Args:
        seed: random seed.
        width, height: of the rectangle [m].
        density: texels per metre.
    """
    shape = (round(height * density) + 1, round(width * density) + 1)
    generator = np.random.default_rng([seed, 4])
    fibres = gaussian_filter(generator.standard_normal(shape, np.float32), 0.0006 * density, mode="wrap")
    texels = np.array(_PAPER, np.float32) * (1 + 0.04 * fibres / fibres.std())[..., None]
    b, a = np.indices(shape) / density
    for number in range(90):
        (u, v), radius = generator.random(2) * (width, height), generator.uniform(0.003, 0.011)
        texels[np.hypot(a - u, b - v) < radius] = _INKS[number % len(_INKS)]
    blurred = gaussian_filter(texels, (0.001 * density, 0.001 * density, 0), mode="nearest")
    return Texture(np.ascontiguousarray(blurred.clip(0.02, 1)), density)


def checkerboard(width: float, height: float, square: float, density: float = 1600.0) -> Texture:
    """Checkerboard of squares of edge `square` [m] with reflectivities 0.25 and 0.85, blurred by 1 mm."""
    shape = (round(height * density) + 1, round(width * density) + 1)
    b, a = np.indices(shape) / density
    black = (np.floor(a / square) + np.floor(b / square)) % 2 == 0
    plane = gaussian_filter(np.where(black, 0.25, 0.85), 0.001 * density, mode="nearest").astype(np.float32)
    return Texture(np.repeat(plane[..., None], 4, axis=-1), density)
