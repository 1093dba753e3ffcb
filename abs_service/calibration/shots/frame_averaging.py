"""Mean images of what is at rest: a board's corners lie more surely in them than in any single image."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots.shots import OWN_LIGHT, SOUGHT, Look, pixels
from drivers.contract.frame import Frame, Kind

#: Images whose mean the mean of the others is compared with, to see whether anything moved.
_FIRST = 5


class MeanLooks:
    """The mean image of every sensor whose frames were added, of the kind in which corners are sought best."""

    def __init__(self) -> None:
        self._means: dict[tuple[str, Kind], _Mean] = {}

    def add(self, frame: Frame) -> None:
        """Takes a frame of any kind; those in which no board can be seen do not count."""
        if frame.kind in SOUGHT:
            self._means.setdefault((frame.sensor, frame.kind), _Mean()).add(frame)

    def looks(self) -> dict[str, Look]:
        """What each sensor saw on average, by sensor; the image before it is the mean of the first few."""
        found: dict[str, Look] = {}
        for (sensor, kind), mean in sorted(self._means.items(), key=lambda item: -SOUGHT.index(item[0][1])):
            image = mean.image()
            before = mean.first() if mean.moves_show else image
            found[sensor] = Look(mean.t_ns, image, before, kind in OWN_LIGHT)
        return found


class _Mean:
    """Sums of the first images and of those after them."""

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
        """Whether there are enough images to compare some with others."""
        return self._counts[1] > 0

    def first(self) -> NDArray[Any]:
        return self._typed(self._sums[0] / self._counts[0])

    def image(self) -> NDArray[Any]:
        """Of those after the first, if there are any: a board that was put elsewhere then is elsewhere wholly."""
        part = int(self.moves_show)
        return self._typed(self._sums[part] / self._counts[part])

    def _typed(self, mean: NDArray[np.float64]) -> NDArray[Any]:
        # In the type of the images, so that what saturates can be told.
        whole = self._type.kind in "ui"
        return (np.rint(mean) if whole else mean).astype(self._type)
