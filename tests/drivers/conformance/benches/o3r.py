"""The ifm O3R through the real ifm3dpy, on an emulated processing unit."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drivers.contract.device import Device
from drivers.contract.errors import SdkMissingError
from drivers.o3r import library
from drivers.o3r.opening import open_device
from tests.drivers.conformance.bench import Fault
from tests.drivers.o3r.emulated_unit import SERIALS
from tests.drivers.o3r.unit_process import UnitProcess


class O3rBench:
    def __init__(self, unit: UnitProcess) -> None:
        self._unit = unit

    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open(SERIALS[0], fault)

    def open_second(self) -> Device:
        return self._open(SERIALS[1], Fault.NONE)

    def _open(self, serial: str, fault: Fault) -> Device:
        self._unit.emulate(serial, fault.value)
        return open_device(self._unit.uri(serial), time.monotonic_ns)


@contextmanager
def bench() -> Iterator[O3rBench]:
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(f"{error}, or  make all")
    with UnitProcess() as unit:
        yield O3rBench(unit)
