"""Images of a rig as arrays, with what is needed to interpret them."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from absmsg.v1.frame_info_pb2 import FrameInfo
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from numpy.typing import NDArray

from abs_client.connection.link import Link
from abs_client.connection.received import Received, decoded, decoded_bytes
from abs_client.connection.wake import Wake
from abs_client.errors import MalformedError
from abs_client.stream import Stream

#: Longest time that a reader waits for a signal before it looks again [s].
POLL_S = 1.0

_PIXELS = {
    "mono8": ("u1", 1),
    "mono16": ("<u2", 1),
    "16UC1": ("<u2", 1),
    "32FC1": ("<f4", 1),
    "rgb8": ("u1", 3),
    "bgr8": ("u1", 3),
    **{f"bayer_{order}8": ("u1", 1) for order in ("rggb", "bggr", "gbrg", "grbg")},
}


class ImageError(MalformedError):
    """An image whose pixels cannot be read."""


@dataclass(frozen=True)
class Image:
    """An image as a sensor measured it.

    Attributes:
        pixels: as measured, read-only, (height, width) or (height, width, 3).
        encoding: of the pixels: rgb8, bgr8, mono8, 16UC1, …, as in foxglove.RawImage.
        info: kind, scale, unit, exposure, clock and more, as it was published.
    """

    pixels: NDArray
    encoding: str
    info: FrameInfo

    @property
    def t_host_ns(self) -> int:
        """Moment of the exposure on the monotonic clock of the cameras' host [ns]."""
        return self.info.header.t_host_ns

    @cached_property
    def values(self) -> NDArray[np.float32]:
        """The pixels in `info.unit`, of depth images metres; NaN without return.

        `info.geometry` says along which line metres are: GEOMETRY_Z or GEOMETRY_RADIAL.
        """
        values = self.pixels * np.float32(self.info.scale)
        if self.info.HasField("invalid"):
            values[self.pixels == self.info.invalid] = np.nan
        values.setflags(write=False)
        return values


class _ImageSource:
    """The newest image of a stream; see `stream.Source`."""

    def __init__(self, wake: Wake) -> None:
        self._wake = wake
        self._lock = threading.Lock()
        self._newest: Image | None = None
        self.skipped = 0

    def put(self, one: Received) -> None:
        # Read here, where a malformed one is counted: in `take` it would end the reader's loop.
        image = read(one)
        with self._lock:
            self.skipped += self._newest is not None
            self._newest = image
        self._wake.signal()

    def take(self) -> Image | None:
        with self._lock:
            newest, self._newest = self._newest, None
            return newest

    def due_s(self) -> float:
        return POLL_S


def images(link: Link, sensor: str, stream: str) -> Stream[Image]:
    """The images of a sensor's stream, the newest first and only."""
    wake = Wake()
    source = _ImageSource(wake)
    end: Callable[[], None] = link.subscribe(f"{sensor}/{stream}/image", source.put)
    return Stream(source, wake, link, end)


def read(one: Received) -> Image:
    """The image in a message.

    Raises:
        MalformedError: there is no image in it, or no description of one.
        ImageError: its pixels are not as many as it says, or in an unknown encoding.
    """
    image, info = decoded(RawImage, one), decoded_bytes(FrameInfo, one.attachment, one.key)
    if image.encoding not in _PIXELS:
        raise ImageError(f"{one.key}: encoding {image.encoding!r} is none of {', '.join(_PIXELS)}")
    dtype, channels = _PIXELS[image.encoding]
    shape = (image.height, image.width) if channels == 1 else (image.height, image.width, channels)
    if len(image.data) != math.prod(shape) * np.dtype(dtype).itemsize:
        raise ImageError(f"{one.key}: {len(image.data)} bytes are no image {image.encoding} of {shape} pixels")
    return Image(np.frombuffer(image.data, dtype).reshape(shape), image.encoding, info)
