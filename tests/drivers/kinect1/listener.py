"""A sink that keeps what it hears and lets a test wait for it."""

import threading
from collections.abc import Callable

from drivers.contract.device import DeviceState, Truth
from drivers.contract.frame import Frame


class Listener:
    """Keeps frames, states and warnings."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.states: list[tuple[DeviceState, str]] = []
        self.warnings: list[tuple[str, str]] = []
        self._news = threading.Condition()

    def on_frame(self, frame: Frame) -> None:
        with self._news:
            self.frames.append(frame)
            self._news.notify_all()

    def on_truth(self, truth: Truth) -> None:
        raise AssertionError("a real device knows no truth")

    def on_state(self, state: DeviceState, reason: str) -> None:
        with self._news:
            self.states.append((state, reason))
            self._news.notify_all()

    def on_warning(self, condition: str, message: str) -> None:
        self.warnings.append((condition, message))

    def of(self, stream: str) -> list[Frame]:
        """The frames of a stream."""
        return [frame for frame in self.frames if frame.stream == stream]

    def wait(self, condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
        """Waits until the condition holds; it is looked at whenever something was heard."""
        with self._news:
            assert self._news.wait_for(condition, timeout_s), f"heard {self.states} and {len(self.frames)} frames"

    def wait_for(self, state: DeviceState) -> str:
        """Waits for a state; returns why it came."""
        self.wait(lambda: any(seen == state for seen, _ in self.states))
        return next(reason for seen, reason in self.states if seen == state)
