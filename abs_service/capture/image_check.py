"""Checks of a camera by its images: images that repeat the one before, images without a measurement."""

import numpy as np
from numpy.typing import NDArray

from drivers.contract.frame import Frame, Kind

#: Pixels along each axis that are looked at first; where they differ, the others need not be.
SAMPLES = 48


class RepeatedImages:
    """Recognises an image that is that of the exposure before, bit for bit. A sensor with noise makes no such image."""

    def __init__(self) -> None:
        self._latest: dict[tuple[str, str], NDArray[np.generic]] = {}

    def add(self, frame: Frame) -> bool:
        """True if a frame's image is that of the frame of its stream that was added before."""
        before, self._latest[frame.key] = self._latest.get(frame.key), frame.data
        if before is None or before.shape != frame.data.shape or before.dtype != frame.data.dtype:
            return False
        # As bytes, because NaN equals nothing.
        return _sampled(before).tobytes() == _sampled(frame.data).tobytes() and before.tobytes() == frame.data.tobytes()


def is_empty(frame: Frame) -> bool:
    """True if no pixel holds a measurement; of a picture, if all its pixels are alike."""
    if frame.kind == Kind.BINARY:
        return False
    return _holds_nothing(frame, _sampled(frame.data)) and _holds_nothing(frame, frame.data)


def _holds_nothing(frame: Frame, values: NDArray[np.generic]) -> bool:
    if values.dtype.kind == "f":
        return bool((np.isnan(values) | (values == frame.invalid)).all())
    nothing = values[0, 0] if frame.invalid is None else frame.invalid
    return bool((values == nothing).all())


def _sampled(image: NDArray[np.generic]) -> NDArray[np.generic]:
    rows, columns = (max(size // SAMPLES, 1) for size in image.shape[:2])
    return image[::rows, ::columns]
