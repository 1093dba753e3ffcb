"""Connection to a processing unit and one of its heads through ifm3d.

A frame grabber serves one run: after an error, ifm3d 1.6 cannot use it again. Constructing one asks the unit while the
interpreter is locked, so the unit is asked without the lock before, and a silent one found out by that.
"""

from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from drivers.contract.device import DeviceError
from drivers.o3r import live_message
from drivers.o3r.heads import Head
from drivers.o3r.library import reason, translated_errors

#: Timeout of the first images [s].
_FIRST_S = 5.0


class HeadLink:
    """Connection to one head.

    Args:
        ifm3d: the module.
        unit: an `ifm3dpy.O3R`.
        head: one of its heads.
        uri: its address, for errors.
    """

    def __init__(self, ifm3d: Any, unit: Any, head: Head, uri: str) -> None:
        self.ifm3d = ifm3d
        self.head = head
        self._unit = unit
        self._uri = uri

    def grab(self, on_message: Callable[[Any], None], on_error: Callable[[RuntimeError], None]) -> Any:
        """A frame grabber that has begun.

        Args:
            on_message: called with every message, from a thread of ifm3d; must neither raise nor wait.
            on_error: called in the same way when the connection has ended.

        Raises:
            DeviceError: the unit does not answer.
        """
        with translated_errors(self._uri):
            self._unit.device_type(False)  # never from its cache
            grabber = self.ifm3d.FrameGrabber(self._unit, self.head.pcic_port)
            grabber.on_new_frame(on_message)
            grabber.on_error(on_error)
            grabber.start(live_message.wanted(self.ifm3d))
            return grabber

    def first(self) -> Any:
        """The first message of a run of its own.

        Raises:
            DeviceError: the unit does not answer, or sends no images.
        """
        messages: SimpleQueue[Any] = SimpleQueue()
        grabber = self.grab(messages.put, messages.put)
        try:
            message = messages.get(timeout=_FIRST_S)
        except Empty as error:
            raise DeviceError(f"{self._uri}: no image has come for {_FIRST_S:g} s") from error
        finally:
            end(grabber)
        if isinstance(message, RuntimeError):
            raise DeviceError(f"{self._uri}: {reason(message)}")
        return message


def end(grabber: Any) -> None:
    """Ends a run, and waits for its thread; afterwards the grabber can be freed without blocking the interpreter."""
    with suppress(RuntimeError):
        grabber.stop().wait()
