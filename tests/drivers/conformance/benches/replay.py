"""Recordings as devices, with faults in the file, or of its disk."""

import errno
import os
import tempfile
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.contract.device import Device, Truth
from drivers.contract.frame import Frame
from drivers.opening import open_device
from drivers.replay import Recording, ReplayDevice
from tests.drivers.conformance.bench import BEFORE, Fault
from tests.drivers.replay import recordings

HOUR_NS = 3_600_000_000_000
COUNT = 30


class ReplayBench:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        items = [item for item in recordings.recorded(COUNT) if isinstance(item, Truth) or item.sensor == "tof"]
        for fault in Fault:
            recordings.write(self._path(fault), [_spoilt(item, fault) for item in items], sensors=("tof",))
        recordings.write(self.folder / "second.mcap", items, sensors=("tof",))

    def open(self, fault: Fault = Fault.NONE) -> Device:
        uri = f"replay://{self._path(fault)}?loop={int(fault == Fault.NONE)}"
        if fault == Fault.UNPLUG:
            return ReplayDevice(uri, _Unplugged(self._path(fault)), 1.0, False, time.monotonic_ns)
        return open_device(uri, time.monotonic_ns)

    def open_second(self) -> Device:
        return open_device(f"replay://{self.folder}/second.mcap?loop=1", time.monotonic_ns)

    def _path(self, fault: Fault) -> Path:
        # One name, by which a recording is known, in a folder for each fault.
        (self.folder / fault).mkdir(exist_ok=True)
        return self.folder / fault / "first.mcap"


class _Unplugged(Recording):
    """A recording on a disk that is taken away while it plays."""

    def frames(self, streams: Collection[tuple[str, str]] = ()) -> Iterator[Frame | Truth]:
        for count, item in enumerate(super().frames(streams)):
            if count > 2 * BEFORE:
                raise OSError(errno.EIO, os.strerror(errno.EIO), str(self.path))
            yield item


def _spoilt(item: Frame | Truth, fault: Fault) -> Frame | Truth:
    if item.seq < BEFORE or isinstance(item, Truth):
        return item
    match fault:
        case Fault.STALL:
            return replace(item, t_host_ns=item.t_host_ns + HOUR_NS)
        case Fault.WRONG_SIZE | Fault.DROP if item.seq < 2 * BEFORE:
            # A file loses a frame by holding one that does not fit.
            return replace(item, data=item.data[:-1])
        case Fault.NAN if item.invalid is not None and item.seq < 2 * BEFORE:
            return replace(item, data=np.full_like(item.data, item.invalid))
    return item


@contextmanager
def bench() -> Iterator[ReplayBench]:
    with tempfile.TemporaryDirectory() as folder:
        yield ReplayBench(Path(folder))
