"""A sheet with a print, seen by a time-of-flight camera that also delivers a grey image."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from drivers.contract.frame import Frame, FrameSet, Kind
from evaluation.scenes.geometries import MovingSheet
from evaluation.scenes.rendering import Renderer, View
from evaluation.scenes.surfaces import Sheet, SplineSurface, Wall
from evaluation.scenes.time_of_flight import SR4000, TimeOfFlight, frame_set

#: Background, and maximum of the grey image [levels].
WALL, FULL_SCALE = Wall(2.0, 0.5, (90.0, 90.0, 90.0)), 255.0

#: Standard deviation of the grey image [levels].
GREY_DEVIATION = 4.0

#: Rendered points along the short and the long side: 0.5 sub-pixels apart.
DENSE = 420, 560

#: Number of exposures averaged to the first frame, in which the sheet rests and its appearance is taken.
REST = 100

RATE_HZ = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Print:
    """Texture of a sheet.

    Attributes:
        reflectivity: in the camera's own infra-red light (h, w), 0…1.
        grey: in ambient light [levels] (h, w).
    """

    reflectivity: NDArray[np.float64]
    grey: NDArray[np.float64]


def random_print(generator: np.random.Generator) -> Print:
    """Black spots (0.05) on white (0.9) in infra-red, and a smoother pattern in ambient light."""
    spots, soft = (_smooth_noise(generator, size) for size in (6.0, 9.0))
    return Print(0.05 + 0.85 / (1 + np.exp(-4 * spots)), 128 + 100 * np.tanh(0.6 * soft))


def _smooth_noise(generator: np.random.Generator, size: float) -> NDArray[np.float64]:
    """Smooth noise (96, 128) with mean 0 and standard deviation 1; the sheet's width is 128."""
    smooth = gaussian_filter(generator.standard_normal((96, 128)), size, mode="reflect")
    return (smooth - smooth.mean()) / smooth.std()


class PrintedSheet:
    """One sheet in front of one camera.

    Args:
        sheet: its motion.
        sensor: the camera.
        texture: its print.
    """

    def __init__(self, sheet: MovingSheet, sensor: TimeOfFlight, texture: Print):
        self.sheet = sheet
        self.sensor = sensor
        self._renderer = Renderer(SR4000, WALL)
        self._dense = SplineSurface((4, 4), 2, np.linspace(0, 1, DENSE[0]), np.linspace(0, 1, DENSE[1]))
        self._reflectivity = texture.reflectivity
        self._color = np.repeat(texture.grey[..., None], 3, axis=2)

    def control(self, k: int) -> NDArray[np.float64]:
        """True control points (4, 4, 3) [m] of frame k."""
        return self.sheet.control(k / RATE_HZ)

    def view(self, control: NDArray[np.float64]) -> View:
        """Noise-free view of a sheet with control points (4, 4, 3)."""
        return self._renderer.render(Sheet(self._dense.points(control), self._reflectivity, self._color))

    def frames(self, count: int, generator: np.random.Generator, rest: int = REST) -> Iterator[FrameSet]:
        """Distance, amplitude and grey image of `count` frames; the first is the mean of `rest` exposures.

        Equal generators draw equal noise, whatever `rest` is.
        """
        for k in range(count):
            view, exposures = self.view(self.control(k)), rest if k == 0 else 1
            t_ns = round((k + 1) * 1e9 / RATE_HZ)
            frames = frame_set(self.sensor.measure(view, generator, exposures), k, t_ns)
            noise = GREY_DEVIATION * generator.standard_normal(view.share.shape) / np.sqrt(exposures)
            grey = np.clip(view.color[..., 0] + noise, 0, FULL_SCALE).astype("<f4")
            image = Frame("tof", "intensity", Kind.INTENSITY, grey, "32FC1", t_ns, t_ns, k)
            yield replace(frames, frames={**frames.frames, image.key: image})
