"""Which part of a camera's image the object can be in: nothing beside it needs to be prepared for a frame."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.projection import Projection
from calib.camera import Camera
from calib.jit import kernel

Number = TypeVar("Number", bound=np.generic)

#: Rows and columns of an image.
Window = tuple[slice, slice]

WHOLE: Window = (slice(None), slice(None))


def around(camera: Camera, projection: Projection, predicted: Surface, reach_m: float) -> Window:
    """The rows and columns that a surface can be in.

    Args:
        camera: that looks.
        projection: of the same camera.
        predicted: where the surface is expected, a population of one.
        reach_m: how far it may be from there [m]; infinite: anywhere.
    """
    place, inverse_z = projection.project(predicted.vertices)
    nearest = inverse_z.max(initial=0.0)
    if not np.isfinite(reach_m * nearest):
        return WHOLE
    margin = reach_m * max(camera.fx, camera.fy) * nearest + 2
    size = np.array([camera.width, camera.height])
    first = np.clip(np.floor(place[0].min(axis=0) - margin), 0, size).astype(int)
    last = np.clip(np.ceil(place[0].max(axis=0) + margin) + 1, first, size).astype(int)
    return slice(int(first[1]), int(last[1])), slice(int(first[0]), int(last[0]))


class Bordered:
    """An image with a border of one pixel that is filled within a window; its memory serves frame after frame.

    New memory takes as long as filling it.

    Args:
        border: what the border holds (channels,).
        beyond: what the image holds beside the window (channels,).
    """

    def __init__(self, border: NDArray[np.float32], beyond: NDArray[np.float32]):
        self._border = border
        self._beyond = beyond
        self._image = np.zeros((0, 0, len(border)), np.float32)
        self._window = WHOLE

    def begin(self, shape: tuple[int, ...], window: Window) -> NDArray[np.float32]:
        """The image (height + 2, width + 2, channels) of a shape (height, width), with `border` in the window too."""
        height, width = shape
        if self._image.shape[:2] != (height + 2, width + 2):
            self._image = np.empty((height + 2, width + 2, len(self._border)), np.float32)
            self._image[:] = self._border
            self._window = WHOLE
        for part, value in ((self._window, self._beyond), (window, self._border)):
            rows, columns = (axis.indices(size) for axis, size in zip(part, (height, width)))
            _fill(self._image, *rows[:2], *columns[:2], value)
        self._window = window
        return self._image


def placed(window: Window, values: NDArray[Number], height: int, width: int) -> NDArray[Number]:
    """Values of the pixels of a window in an image (height + 2, width + 2) with a border; zeros elsewhere."""
    image = np.zeros((height + 2, width + 2), values.dtype)
    image[1:-1, 1:-1][window] = values
    return image


@kernel
def _fill(image: NDArray[np.float32], top: int, bottom: int, left: int, right: int, value: NDArray[np.float32]) -> None:
    """Writes a value (channels,) into rows and columns of an image with a border, which do not count it."""
    for row in range(top + 1, bottom + 1):
        for column in range(left + 1, right + 1):
            for channel in range(value.size):
                image[row, column, channel] = value[channel]
