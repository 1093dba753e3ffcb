"""An open camera, its features and its buffers.

Harvesters' own decoding of buffers knows no formats of manufacturers; buffers are taken as they are.
"""

import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from typing import Any

from drivers.contract.device import DeviceError
from drivers.contract.errors import translated_sdk_errors

#: Buffers that the producer fills meanwhile.
_BUFFERS = 6
#: Longest time in `take` [s]: genicam holds the interpreter's lock while it waits, so nothing may wait there.
_POLL_S = 1e-5
#: GenTL's payload type of a buffer with several images.
_MULTI_PART = 10


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One image of a buffer.

    Attributes:
        pixel_format: its GenICam name.
        width, height: its size [px].
        data: rows of pixels; behind the last one there may be chunks.
        padding: behind each row [bytes].
    """

    pixel_format: str
    width: int
    height: int
    data: memoryview
    padding: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """The images of one exposure.

    Attributes:
        number: of the exposure, counted by the camera.
        time_ns: its time on the camera's clock [ns]; None if the producer has no time stamps.
        parts: the images.
    """

    number: int
    time_ns: int | None
    parts: tuple[Part, ...]


class CameraLink:
    """A camera that is open. Thread-safe, but for `start`, `take` and `stop`, which one thread calls at a time.

    Args:
        core: `harvesters.core`.
        acquirer: `core.ImageAcquirer` of the camera.
        uri: of the camera, for messages.
    """

    def __init__(self, core: Any, acquirer: Any, uri: str) -> None:
        self.uri = uri
        self._names = core.dict_by_ints
        self._acquirer: Any = acquirer
        self._lock = threading.Lock()
        acquirer.num_buffers = _BUFFERS
        acquirer.timeout_period_on_update_event_data_call = 0

    @property
    def nodes(self) -> Any:
        """The camera's features (`genicam.genapi.NodeMap`).

        Raises:
            DeviceError: the link was closed.
        """
        acquirer = self._acquirer
        if acquirer is None:
            raise DeviceError(f"{self.uri}: the device was closed")
        return acquirer.remote_device.node_map

    def translated_errors(self) -> AbstractContextManager[None]:
        """Translates exceptions of GenTL and GenApi into errors that name the device.

        Raises:
            DeviceError: any exception.
        """
        return translated_sdk_errors(self.uri, "another program may use the camera")

    def start(self) -> None:
        """Starts the camera.

        Raises:
            DeviceError: it does not start.
        """
        with self.translated_errors():
            self._acquirer.start()

    def take(self) -> Shot | None:
        """The next exposure; None if there is none now, or it is incomplete.

        Raises:
            DeviceError: the camera is gone.
        """
        with self.translated_errors():
            buffer = self._acquirer.try_fetch(timeout=_POLL_S, is_raw=True)
            if buffer is None:
                return None
            try:
                return Shot(int(buffer.frame_id), _reported(buffer, "timestamp_ns"), tuple(self._parts(buffer)))
            finally:
                buffer.parent.queue_buffer(buffer)

    def stop(self) -> None:
        """Stops the camera, also one that is gone."""
        acquirer = self._acquirer
        if acquirer is not None:
            with suppress(Exception):  # the producer's, for a lost camera
                acquirer.stop()

    def close(self) -> None:
        """Stops and releases the camera; idempotent."""
        with self._lock:
            acquirer, self._acquirer = self._acquirer, None
        if acquirer is not None:
            with suppress(Exception):  # the producer's, for a lost camera
                acquirer.destroy()

    def _parts(self, buffer: Any) -> Iterator[Part]:
        content = memoryview(bytearray(buffer.raw_buffer))  # a copy: the memory is filled again once it is queued
        if buffer.payload_type == _MULTI_PART:
            for part in buffer.parts:
                name = self._names.get(part.data_format, f"{part.data_format:#x}")
                data = content[part.data_offset : part.data_offset + part.data_size]
                yield Part(name, part.width, part.height, data, _reported(part, "x_padding") or 0)
        else:  # the feature tells formats of manufacturers, too
            size, data = (int(buffer.width), int(buffer.height)), content[: int(buffer.size_filled)]
            yield Part(self.nodes.PixelFormat.value, *size, data, _reported(buffer, "padding_x") or 0)


def _reported(buffer: Any, name: str) -> int | None:
    """A number of a buffer, or of a part of one; None if the producer does not report it."""
    try:
        return int(getattr(buffer, name))
    except Exception:  # the producer's own
        return None
