"""The part of a depth image in which a sensor measures: what is cut off by its end does not end there itself.

Structured light finds no match in the last columns at one side, and registration to another camera leaves margins at
all sides. A depth camera of a tracker is therefore that of the part of its images that the first one fills.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Image, Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.synthesis.window import corner
from calib.noise.base import DepthNoise, Mapped
from calib.noise.part_of_image import PartOfImage
from calib.rig import Rig, Sensor

#: Rows or columns without return at a side are a margin up to this share of the image's size; more are a background.
LARGEST_SHARE = 0.08
#: The first row or column of a margin has returns at no more than this share of its pixels.
STRAY_SHARE = 0.01
#: A margin ends at this share of the returns that rows or columns behind it have; margins may be slightly curved.
END_SHARE = 0.5
#: These returns are at least this share of their pixels: less may be an object before a background without return.
LEAST_FILLED = 0.5


@dataclass(frozen=True)
class FieldOfView:
    """Rows and columns of the images of depth sensors, by name, that are tracked; other images are so as a whole."""

    windows: Mapping[str, Window]

    @classmethod
    def of(cls, images: Mapping[str, Image]) -> Self:
        """That of the first images."""
        depth = {name: image for name, image in images.items() if isinstance(image, DepthImage)}
        windows = {name: filled(np.isfinite(image.distance)) for name, image in depth.items()}
        return cls({name: window for name, window in windows.items() if window is not None})

    def of_rig(self, rig: Rig) -> Rig:
        """The rig with the cameras of the parts."""
        parts = {name: _cropped(rig.sensors[name], window) for name, window in self.windows.items()}
        return replace(rig, sensors={name: parts.get(name, sensor) for name, sensor in rig.sensors.items()})

    def of_observation(self, observation: Observation) -> Observation:
        """The observation with the parts of its images."""
        if not self.windows:
            return observation
        images = {name: self._part(name, image) for name, image in observation.images.items()}
        return replace(observation, images=images)

    def _part(self, name: str, image: Image) -> Image:
        if name in self.windows and isinstance(image, DepthImage):
            return image.cropped(self.windows[name])
        return image


def _cropped(sensor: Sensor, window: Window) -> Sensor:
    """The sensor whose image is a part of that of another one."""
    noise = sensor.noise
    if isinstance(noise, DepthNoise) and isinstance(noise, Mapped):
        noise = PartOfImage(noise, *corner(window))
    return replace(sensor, camera=sensor.camera.cropped(*window), noise=noise)


#: Images as a whole.
EVERYTHING = FieldOfView({})


def filled(returns: NDArray[np.bool_]) -> Window | None:
    """Rows and columns of an image without its margins; None if it has none.

    Args:
        returns: True (height, width) where something was measured.
    """
    rows, columns = (_between_margins(returns.sum(axis=axis), returns.shape[axis]) for axis in (1, 0))
    whole = (rows, columns) == tuple(slice(0, size) for size in returns.shape)
    return None if whole else (rows, columns)


def _between_margins(counts: NDArray[np.intp], length: int) -> slice:
    """The rows or columns between margins at both ends, from the number of returns in each and their length [px]."""
    return slice(_margin(counts, length), len(counts) - _margin(counts[::-1], length))


def _margin(counts: NDArray[np.intp], length: int) -> int:
    """Width of the margin at the beginning [px]; 0 if there is none."""
    near = counts[: round(LARGEST_SHARE * len(counts)) + 1]
    behind = near.max()
    if near[0] > STRAY_SHARE * length or behind < LEAST_FILLED * length:
        return 0
    return int(np.argmax(near >= END_SHARE * behind))
