"""The simulated device with its own fault injection."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.contract.device import Device
from drivers.opening import open_device
from tests.drivers.conformance.bench import BEFORE, Fault

URI = "simulated://sheet?sensors=tof&tof=32x24&rate=60&seed="


class SimulatedBench:
    def open(self, fault: Fault = Fault.NONE) -> Device:
        return open_device(f"{URI}1" + (f"&fault={fault}@{BEFORE}" if fault != Fault.NONE else ""), time.monotonic_ns)

    def open_second(self) -> Device:
        return open_device(f"{URI}2", time.monotonic_ns)


@contextmanager
def bench() -> Iterator[SimulatedBench]:
    yield SimulatedBench()
