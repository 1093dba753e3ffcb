"""A sink that records everything, for tests of drivers."""

import threading
import time
from collections.abc import Callable

from drivers.contract.device import DeviceState, Truth
from drivers.contract.frame import Frame

#: Timeout of all waits [s].
TIMEOUT_S = 20.0


class RecordingSink:
    """Records frames, truths, states and warnings, and waits for conditions on them."""

    def __init__(self) -> None:
        self.items: list[Frame | Truth] = []  # in the order in which they came
        self.frames: list[Frame] = []
        self.truths: list[Truth] = []
        self.states: list[tuple[DeviceState, str]] = []
        self.warnings: list[tuple[str, str]] = []
        self.changed = threading.Condition()

    def on_frame(self, frame: Frame) -> None:
        with self.changed:
            self.items.append(frame)
            self.frames.append(frame)
            self.changed.notify_all()

    def on_truth(self, truth: Truth) -> None:
        with self.changed:
            self.items.append(truth)
            self.truths.append(truth)
            self.changed.notify_all()

    def on_state(self, state: DeviceState, reason: str) -> None:
        with self.changed:
            self.states.append((state, reason))
            self.changed.notify_all()

    def on_warning(self, condition: str, message: str) -> None:
        with self.changed:
            self.warnings.append((condition, message))

    def of(self, stream: str) -> list[Frame]:
        """The frames of a stream."""
        return [frame for frame in self.frames if frame.stream == stream]

    def wait(self, condition: Callable[[], bool], timeout_s: float = TIMEOUT_S) -> None:
        """Asserts that the condition becomes true in time."""
        with self.changed:
            assert self.changed.wait_for(condition, timeout_s), f"{self.states} and {len(self.frames)} frames"

    def wait_for(self, state: DeviceState) -> str:
        """Asserts that the state is reached in time; returns its reason."""
        self.wait(lambda: any(reached == state for reached, _ in self.states))
        return next(reason for reached, reason in self.states if reached == state)

    def receives(self, frames: int, timeout_s: float = TIMEOUT_S) -> bool:
        """True if so many more frames arrive in time."""
        with self.changed:
            enough = len(self.frames) + frames
            return self.changed.wait_for(lambda: len(self.frames) >= enough, timeout_s)

    def reaches(self, state: DeviceState, timeout_s: float = TIMEOUT_S) -> bool:
        """True if the state was or is reached in time."""
        with self.changed:
            return self.changed.wait_for(lambda: any(reached == state for reached, _ in self.states), timeout_s)

    def falls_silent(self, for_s: float = 0.5, timeout_s: float = TIMEOUT_S) -> bool:
        """True if frames stop in time."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            if not self.receives(1, for_s):
                return True
        return False

    def settle(self) -> int:
        """Number of frames, after a moment in which more could have come."""
        time.sleep(0.2)
        return len(self.frames)
