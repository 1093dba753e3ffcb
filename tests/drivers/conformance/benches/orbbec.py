"""Playback by Orbbec's SDK of recordings with faults in them."""

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.contract.device import Device, DeviceState
from drivers.contract.errors import SdkMissingError
from drivers.orbbec import library
from drivers.orbbec.address import parse
from drivers.orbbec.opening import of_origin, playback
from tests.drivers.conformance.bench import BEFORE, Fault
from tests.drivers.orbbec import takes

#: Longer than any of the tests takes.
IMAGES = 20 * takes.RATE_HZ


class OrbbecBench:
    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open("0001", fault)

    def open_second(self) -> Device:
        return self._open("0002", Fault.NONE)

    def _open(self, serial: str, fault: Fault) -> Device:
        path = self.folder / f"{serial}_{fault}.bag"
        if not path.exists():
            takes.write(path, serial, IMAGES, fault, after=BEFORE + 2)
        ob = library.load()
        address = parse(f"orbbec://?recording={path}")
        origin = playback(ob, library.context(ob), address)
        if fault == Fault.UNPLUG:  # the end of a recording stands for the loss of a camera
            ended = origin.ended
            origin = replace(origin, ended=lambda: (DeviceState.FAILED, "the camera is gone") if ended() else None)
        return of_origin(origin, address, time.monotonic_ns)


@contextmanager
def bench() -> Iterator[OrbbecBench]:
    pytest.importorskip("rosbags", reason="make all")
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(str(error))
    with tempfile.TemporaryDirectory() as folder:
        yield OrbbecBench(Path(folder))
