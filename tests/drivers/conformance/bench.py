"""Interface of the conformance tests: a bench sets up a fake device of a driver with injectable faults.

`test_conformance.py` and `test_faults.py` run the same tests for every driver. A driver joins by one module
`tests/drivers/conformance/benches/NAME.py` with one function, a context manager that sets up a fake of its device:

    @contextmanager
    def bench() -> Iterator[Bench]:
        with FakeUsb() as fake:
            yield KinectBench(fake)

and a class that implements `Bench` below. If a fake needs a package that is not installed, `bench` calls
`pytest.importorskip` or `pytest.skip` with what to install; no device SDK is imported at the top of the module. Every
fake delivers at least `BEFORE` frames of each stream at 15 Hz or more before its fault, and small images, so that fifty
starts take a few seconds.

On real hardware the tests without faults run with
`pytest tests/drivers/conformance/test_conformance.py -m hardware --device URI`.
"""

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from drivers.contract.device import Device
from tests.drivers.recording_sink import RecordingSink

Open = Callable[[], Device]

#: Frames of each stream that a fake delivers before its fault.
BEFORE = 3


class Fault(StrEnum):
    """Fault that a bench can inject.

    Attributes:
        NONE: the device works.
        DROP: part of the data is lost in transit. The affected frames are dropped and counted.
        STALL: no more data, without an error.
        UNPLUG: the device disappears. The driver reports FAILED and the reason.
        WRONG_SIZE: some images, or their data, have a wrong size; later ones are correct.
        NAN: some depth images have no valid pixel.
    """

    NONE = "none"
    DROP = "drop"
    STALL = "stall"
    UNPLUG = "unplug"
    WRONG_SIZE = "wrong_size"
    NAN = "nan"


class Bench(Protocol):
    """Two fake devices of one kind, with fault injection."""

    def open(self, fault: Fault = Fault.NONE) -> Device:
        """Opens the first device, with the fault soon after its first frames. May be called repeatedly."""
        ...

    def open_second(self) -> Device:
        """Opens another device of the same kind without faults; both may be open at a time."""
        ...


def dropped(device: Device) -> int:
    """Number of dropped frames, for all causes."""
    return sum(device.counters.values()) - device.counters["frames"]


def resources() -> Counter[str]:
    """Resources of the process that can leak: threads by name, and file descriptors."""
    held = Counter(thread.name for thread in threading.enumerate())
    held["descriptors"] = len(list(Path("/proc/self/fd").iterdir()))
    return held


@contextmanager
def streaming(device: Device) -> Iterator[RecordingSink]:
    """A streaming device and its sink; closed at the end."""
    sink = RecordingSink()
    try:
        device.start(sink)
        assert sink.receives(1)
        yield sink
    finally:
        device.close()
