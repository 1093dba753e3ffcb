"""Images from depthai's queues. No Python code runs in depthai's nodes, where an exception would end the process."""

from datetime import timedelta
from typing import Any, Protocol

import numpy as np

from drivers.oak.eeprom import Extrinsics, extrinsics_of
from drivers.oak.images.picture import Picture, PictureError, number

_NS = timedelta(microseconds=1)


class QueueClosed(Exception):  # noqa: N818  an end, not an error
    """No more images: the pipeline was stopped, the recording has ended, or the device was lost."""


class Queue(Protocol):
    """Queue of the newest images of one stream."""

    def get(self, timeout_s: float) -> Picture | None:
        """The next image, None after the timeout.

        Raises:
            PictureError: the message is no valid image.
            QueueClosed: no more images.
        """
        ...

    def clear(self) -> None:
        """Drops all queued images."""
        ...


class OutputQueue:
    """A depthai queue with `blocking=False`: new images replace the oldest ones.

    Args:
        queue: `dai.MessageQueue`.
        socket: of the camera whose view the images are, where the pipeline decides it; None: as the images say.
    """

    def __init__(self, queue: Any, socket: int | None = None) -> None:
        self._queue = queue
        self._socket = socket

    def get(self, timeout_s: float) -> Picture | None:
        """See `Queue.get`."""
        try:
            message = self._queue.get(timedelta(seconds=timeout_s))
        except Exception as error:  # QueueException, whose module cannot be named without importing depthai
            raise QueueClosed(str(error)) from error
        return None if message is None else from_img_frame(message, self._socket)

    def clear(self) -> None:
        """See `Queue.clear`."""
        try:
            self._queue.tryGetAll()
        except Exception as error:
            raise QueueClosed(str(error)) from error


def from_img_frame(message: Any, socket: int | None = None) -> Picture:
    """Picture of a `dai.ImgFrame`; pixels are not copied.

    Args:
        message: the image.
        socket: see `OutputQueue`.

    Raises:
        PictureError: malformed message.
    """
    try:
        return _picture(message, socket)
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:  # exceptions of depthai for invalid contents
        raise PictureError(f"{type(message).__name__} is no image: {error}") from error


def _picture(message: Any, socket: int | None) -> Picture:
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
        socket=message.getInstanceNum() if socket is None else socket,
        matrix=np.array(transformation.getIntrinsicMatrix(), np.float64),
        model=transformation.getDistortionModel().name.upper(),
        coefficients=tuple(transformation.getDistortionCoefficients()),
        extrinsics=_extrinsics(transformation.getExtrinsics()),
    )


def _extrinsics(extrinsics: Any) -> Extrinsics:
    t = extrinsics.translation
    socket, unit = extrinsics.toCameraSocket.value, extrinsics.lengthUnit.value
    return extrinsics_of(extrinsics.rotationMatrix, (t.x, t.y, t.z), socket, unit)


def _ns(time: timedelta) -> int:
    """Nanoseconds; `total_seconds` would round long uptimes."""
    return time // _NS * 1000
