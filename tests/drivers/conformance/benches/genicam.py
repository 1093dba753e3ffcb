"""The GenICam committee's simulated producer (Viky) through the real harvesters; faults come behind them."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.contract.device import Device, DeviceError
from drivers.genicam import library
from drivers.genicam.address import parse
from drivers.genicam.link import CameraLink, Shot
from drivers.genicam.opening import of_link
from tests.drivers.conformance.bench import BEFORE, Fault

#: It tells no focal length.
QUERY = "?focal=500"
WIDTH, HEIGHT = 120, 100


class FaultyLink(CameraLink):
    """Faults begin after some images of the first run."""

    fault = Fault.NONE
    _taken = 0

    def take(self) -> Shot | None:
        if self._taken > BEFORE and self.fault == Fault.UNPLUG:
            raise DeviceError(f"{self.uri}: it is gone")
        shot = super().take()
        if shot is None:
            return None
        self._taken += 1
        if self._taken <= BEFORE + 1:
            return shot
        return self._with_fault(shot)

    def _with_fault(self, shot: Shot) -> Shot | None:
        sometimes = self._taken % 2 == 0
        if self.fault == Fault.STALL or (self.fault == Fault.DROP and sometimes):
            return None
        if self.fault == Fault.WRONG_SIZE and sometimes:
            return replace(shot, parts=tuple(replace(part, height=part.height // 2) for part in shot.parts))
        if self.fault == Fault.NAN:
            return replace(shot, parts=tuple(replace(part, data=_zeros(part.data)) for part in shot.parts))
        return shot


class GenicamBench:
    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open("0", fault)

    def open_second(self) -> Device:
        return self._open("1", Fault.NONE)

    def _open(self, serial: str, fault: Fault) -> Device:
        address = parse(f"genicam://{serial}{QUERY}")
        acquirer, info = library.producers().open(serial, 1.0)
        nodes = acquirer.remote_device.node_map
        nodes.Width.value, nodes.Height.value = WIDTH, HEIGHT
        link = FaultyLink(library.load(), acquirer, address.uri)
        device = of_link(link, info, address, time.monotonic_ns)
        link.fault = fault
        return device


def viky() -> str:
    """Folder of the simulated producer; skips the test without it."""
    folder = Path(pytest.importorskip("genicam", reason="make all").__file__).parent
    pytest.importorskip("harvesters.core", exc_type=ImportError)
    if not (folder / "viky.cti").exists():
        pytest.skip("this version of genicam has no simulated producer")
    return str(folder)


@contextmanager
def bench() -> Iterator[GenicamBench]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(os.environ, library.VARIABLE, viky())
        yield GenicamBench()


def _zeros(data: memoryview) -> memoryview:
    return memoryview(bytes(len(data)))
