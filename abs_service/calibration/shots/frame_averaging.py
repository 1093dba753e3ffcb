"""Mean images of a static scene, in which corners are more accurate than in a single image."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots.shots import OWN_LIGHT, SOUGHT, SensorShot, pixels
from drivers.contract.frame import Frame, Kind

#: Number of initial images whose mean is compared with the mean of the others to detect motion.
_FIRST = 5


class FrameAverager:
    """Mean image of every sensor, of the kind best suited for corner detection."""

    def __init__(self) -> None:
        self._means: dict[tuple[str, Kind], _Mean] = {}

    def add(self, frame: Frame) -> None:
        """Adds a frame; kinds without a visible board are ignored."""
        if frame.kind in SOUGHT:
            self._means.setdefault((frame.sensor, frame.kind), _Mean()).add(frame)

    def sensor_shots(self) -> dict[str, SensorShot]:
        """Mean image of each sensor; `before` is the mean of the first few."""
        found: dict[str, SensorShot] = {}
        for (sensor, kind), mean in sorted(self._means.items(), key=lambda item: -SOUGHT.index(item[0][1])):
            image = mean.image()
            before = mean.first() if mean.moves_show else image
            found[sensor] = SensorShot(mean.t_ns, image, before, kind in OWN_LIGHT)
        return found


class _Mean:
    """Sums of the first images and of the remaining ones."""

    def __init__(self) -> None:
        self.t_ns = 0
        self._type: np.dtype[Any] = np.dtype(np.uint8)
        self._sums: list[NDArray[np.float64]] = []
        self._counts = [0, 0]

    def add(self, frame: Frame) -> None:
        image = pixels(frame)
        if not self._sums:
            self.t_ns, self._type = frame.t_host_ns, image.dtype
            self._sums = [np.zeros(image.shape), np.zeros(image.shape)]
        part = int(self._counts[0] >= _FIRST)
        self._sums[part] += image
        self._counts[part] += 1

    @property
    def moves_show(self) -> bool:
        """True if there are enough images for motion detection."""
        return self._counts[1] > 0

    def first(self) -> NDArray[Any]:
        return self._typed(self._sums[0] / self._counts[0])

    def image(self) -> NDArray[Any]:
        """Mean of the images after the first ones, if any: a board that was moved in between is not blurred."""
        part = int(self.moves_show)
        return self._typed(self._sums[part] / self._counts[part])

    def _typed(self, mean: NDArray[np.float64]) -> NDArray[Any]:
        # In the type of the images, so that saturation can be detected.
        whole = self._type.kind in "ui"
        return (np.rint(mean) if whole else mean).astype(self._type)
