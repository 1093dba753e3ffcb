"""Emulated Azure Kinects whose captures Microsoft's library makes, with faults in them."""

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers.azure import library, open_device
from drivers.contract.device import Device, SdkMissingError
from tests.drivers.azure.attachment import attached
from tests.drivers.azure.emulation import EmulatedKinect
from tests.drivers.azure.test_mkv import CALIBRATION
from tests.drivers.conformance.bench import Fault

#: The smallest image of depth; decoding colours of 720 lines takes 5 ms.
QUERY = "depth=nfov_2x2binned"


class AzureBench:
    def __init__(self, cameras: list[EmulatedKinect]) -> None:
        self.cameras = cameras

    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open(self.cameras[0], fault)

    def open_second(self) -> Device:
        return self._open(self.cameras[1], Fault.NONE)

    def _open(self, camera: EmulatedKinect, fault: Fault) -> Device:
        camera.fault = fault
        return open_device(f"azure://{camera.serial}?{QUERY}", time.monotonic_ns)


@contextmanager
def bench() -> Iterator[AzureBench]:
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(str(error))
    cameras = [EmulatedKinect(serial, CALIBRATION) for serial in ("000123456712", "000123456812")]
    with tempfile.TemporaryDirectory() as folder, attached(Path(folder), *cameras):
        yield AzureBench(cameras)
