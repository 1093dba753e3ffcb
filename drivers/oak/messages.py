"""Images out of depthai's queues. Our Python stays out of its nodes: an exception there ends the process."""

from datetime import timedelta
from typing import Any, Protocol

import numpy as np

from drivers.oak.picture import Picture, PictureError, number

_NS = timedelta(microseconds=1)


class QueueClosed(Exception):  # noqa: N818  an end, not an error
    """There will be no more images: the pipeline was stopped, the recording has ended, or the device is gone."""


class Queue(Protocol):
    """Images of one stream, the newest few."""

    def get(self, timeout_s: float) -> Picture | None:
        """The next image, None if there is none for so long.

        Raises:
            PictureError: what came is no image.
            QueueClosed: there will be none.
        """
        ...

    def clear(self) -> None:
        """Drops what waits in it."""
        ...


class OutputQueue:
    """A queue of depthai, made with `blocking=False`, so that the newest images replace older ones.

    Args:
        queue: `dai.MessageQueue`.
    """

    def __init__(self, queue: Any) -> None:
        self._queue = queue

    def get(self, timeout_s: float) -> Picture | None:
        """See `Queue.get`."""
        try:
            message = self._queue.get(timedelta(seconds=timeout_s))
        except Exception as error:  # QueueException, whose module cannot be named without importing depthai
            raise QueueClosed(str(error)) from error
        return None if message is None else from_img_frame(message)

    def clear(self) -> None:
        """See `Queue.clear`."""
        try:
            self._queue.tryGetAll()
        except Exception as error:
            raise QueueClosed(str(error)) from error


def from_img_frame(message: Any) -> Picture:
    """The picture that a `dai.ImgFrame` is; its pixels stay where they are.

    Raises:
        PictureError: it is none.
    """
    try:
        return _picture(message)
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:  # all that depthai raises about contents
        raise PictureError(f"{type(message).__name__} is no image: {error}") from error


def _picture(message: Any) -> Picture:
    transformation = message.getTransformation()
    return Picture(
        type=message.getType().name,
        width=message.getWidth(),
        height=message.getHeight(),
        stride=message.getStride(),
        data=np.asarray(message.getData(), np.uint8),
        seq=message.getSequenceNum(),
        host_ns=_ns(message.getTimestamp()),
        device_ns=_ns(message.getTimestampDevice()),
        exposure_s=number(message.getExposureTime().total_seconds()),
        gain=number(message.getSensitivity() / 100),
        temperature_c=number(message.getSensorTemperature() or 0.0, 200.0),
        socket=message.getInstanceNum(),
        matrix=np.array(transformation.getIntrinsicMatrix(), np.float64),
        model=transformation.getDistortionModel().name.upper(),
        coefficients=tuple(transformation.getDistortionCoefficients()),
    )


def _ns(time: timedelta) -> int:
    """Nanoseconds; `total_seconds` would round a long uptime."""
    return time // _NS * 1000
