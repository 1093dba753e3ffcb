"""What every driver is tried on, and how a driver joins in.

`test_conformance.py` runs the same tests on every driver. A driver joins by one module `tests/drivers/benches/NAME.py`
with one function, a context manager that sets up a fake of its device and takes it down again:

    @contextmanager
    def bench() -> Iterator[Bench]:
        with FakeUsb() as fake:
            yield KinectBench(fake)

and a class that keeps the promises of `Bench` below. A fake that needs what is not installed calls
`pytest.importorskip`, or `pytest.skip` with what to install, inside `bench`; nothing at the top of the module may
import a device SDK. Every fake device has to deliver at least `BEFORE` frames of each of its streams at 15 Hz or more
before its fault shows, and small images, so that fifty starts take a few seconds.

On real hardware the tests that need no fault run with `pytest tests/drivers/test_conformance.py -m hardware --device
URI`.
"""

import threading
import time
from collections import Counter
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from drivers.contract.device import Device, DeviceState, Truth
from drivers.contract.frame import Frame

#: Frames of each stream that a fake delivers before its fault shows.
BEFORE = 3
#: Longest time that anything is waited for [s].
PATIENCE_S = 20.0


class Fault(StrEnum):
    """What a bench can let happen.

    Attributes:
        NONE: the device works.
        DROP: some of the data is lost on its way, some of it is not. The frames concerned are dropped and counted.
        STALL: from some moment on nothing comes, and no error either.
        UNPLUG: the device disappears. The driver reports FAILED and why.
        WRONG_SIZE: some images, or the data they are made of, have not the size that was promised; later ones have.
        NAN: in some depth images nothing was measured in any pixel.
    """

    NONE = "none"
    DROP = "drop"
    STALL = "stall"
    UNPLUG = "unplug"
    WRONG_SIZE = "wrong_size"
    NAN = "nan"


class Bench(Protocol):
    """Two devices of one kind that a driver can open, on a fake that can go wrong."""

    def open(self, fault: Fault = Fault.NONE) -> Device:
        """Opens the first device, which shows the fault soon after its first frames. May be called repeatedly."""
        ...

    def open_second(self) -> Device:
        """Opens another device of the same kind, which works; both may be open at a time."""
        ...


class Ear:
    """A sink that hears everything, and lets a test wait for what it wants to hear."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.states: list[tuple[DeviceState, str]] = []
        self.warnings: list[tuple[str, str]] = []
        self.changed = threading.Condition()

    def on_frame(self, frame: Frame) -> None:
        with self.changed:
            self.frames.append(frame)
            self.changed.notify_all()

    def on_truth(self, truth: Truth) -> None: ...

    def on_state(self, state: DeviceState, reason: str) -> None:
        with self.changed:
            self.states.append((state, reason))
            self.changed.notify_all()

    def on_warning(self, condition: str, message: str) -> None:
        with self.changed:
            self.warnings.append((condition, message))

    def hears(self, frames: int, timeout_s: float = PATIENCE_S) -> bool:
        """Whether so many more frames come in time."""
        with self.changed:
            enough = len(self.frames) + frames
            return self.changed.wait_for(lambda: len(self.frames) >= enough, timeout_s)

    def hears_state(self, state: DeviceState, timeout_s: float = PATIENCE_S) -> bool:
        """Whether the state is reported in time, or was."""
        with self.changed:
            return self.changed.wait_for(lambda: any(said == state for said, _ in self.states), timeout_s)

    def falls_silent(self, for_s: float = 0.5, timeout_s: float = PATIENCE_S) -> bool:
        """Whether frames cease to come."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            if not self.hears(1, for_s):
                return True
        return False


def eventually(condition) -> bool:
    """Whether a condition comes true in time."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return False


def dropped(device: Device) -> int:
    """Frames that a device says it dropped, for whatever cause."""
    return sum(device.counters.values()) - device.counters["frames"]


def resources() -> Counter[str]:
    """What a process holds that it could forget to give back: threads by name, and descriptors."""
    held = Counter(thread.name for thread in threading.enumerate())
    held["descriptors"] = len(list(Path("/proc/self/fd").iterdir()))
    return held
