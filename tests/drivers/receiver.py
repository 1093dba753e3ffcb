"""A sink that keeps what it is given, for tests of drivers."""

import threading
import time
from collections.abc import Callable

from drivers.contract.device import DeviceState, Truth
from drivers.contract.frame import Frame


class Receiver:
    """Keeps frames and states; `wait` waits until there is enough of them."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.states: list[tuple[DeviceState, str]] = []
        self._changed = threading.Condition()

    def on_frame(self, frame: Frame) -> None:
        with self._changed:
            self.frames.append(frame)
            self._changed.notify_all()

    def on_truth(self, truth: Truth) -> None:
        pass

    def on_state(self, state: DeviceState, reason: str) -> None:
        with self._changed:
            self.states.append((state, reason))
            self._changed.notify_all()

    def on_warning(self, condition: str, message: str) -> None:
        pass

    def wait(self, enough: Callable[[], bool], timeout_s: float = 20.0) -> None:
        with self._changed:
            assert self._changed.wait_for(enough, timeout_s), (self.states, len(self.frames))

    def settle(self) -> int:
        """Number of frames, after a moment in which more could have come."""
        time.sleep(0.2)
        return len(self.frames)
