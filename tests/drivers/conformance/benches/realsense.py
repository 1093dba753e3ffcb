"""The software device of librealsense."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from drivers.contract.device import Device
from drivers.contract.errors import SdkMissingError
from drivers.realsense import library
from drivers.realsense.opening import device_info, of_device
from tests.drivers.conformance.bench import BEFORE, Fault
from tests.drivers.realsense.software_camera import SoftwareCamera


class Pluggable:
    """A software device that can be unplugged."""

    def __init__(self, camera: SoftwareCamera) -> None:
        self._camera = camera

    def query_sensors(self) -> list[Any]:
        return self._camera.device.query_sensors()

    def is_connected(self) -> bool:
        return self._camera.fault != Fault.UNPLUG


class RealsenseBench:
    def __init__(self) -> None:
        self.cameras: dict[str, SoftwareCamera] = {}

    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open("0001", fault)

    def open_second(self) -> Device:
        return self._open("0002", Fault.NONE)

    def _open(self, serial: str, fault: Fault) -> Device:
        if serial in self.cameras:
            self.cameras[serial].halt()
        camera = self.cameras[serial] = SoftwareCamera(serial, fault=fault, after=40 + BEFORE)
        info = device_info(camera.rs, camera.device)
        device = of_device(camera.rs, Pluggable(camera), info, time.monotonic_ns)
        camera.run()
        return device


@contextmanager
def bench() -> Iterator[RealsenseBench]:
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(f"{error}, or  make all")
    made = RealsenseBench()
    try:
        yield made
    finally:
        for camera in made.cameras.values():
            camera.halt()
