"""Devices of every driver."""

import pkgutil
import time
from collections.abc import Iterator
from importlib import import_module

import pytest

from drivers.opening import open_device
from tests.drivers.conformance import benches
from tests.drivers.conformance.bench import Bench, Open

NAMES = sorted(module.name for module in pkgutil.iter_modules(benches.__path__))


@pytest.fixture(params=NAMES)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """The fake of each driver, one after the other."""
    with import_module(f"tests.drivers.conformance.benches.{request.param}").bench() as bench:
        yield bench


@pytest.fixture(params=[*NAMES, pytest.param("hardware", marks=pytest.mark.hardware)])
def opener(request: pytest.FixtureRequest) -> Iterator[Open]:
    """Opens a working device: each driver's fake, or the real one that was named."""
    if request.param == "hardware":
        uri = request.getfixturevalue("device_uri")
        yield lambda: open_device(uri, time.monotonic_ns)
        return
    with import_module(f"tests.drivers.conformance.benches.{request.param}").bench() as bench:
        yield bench.open
