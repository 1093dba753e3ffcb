"""Playback by depthai; faults are injected between its queues and the driver."""

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.contract.device import Device
from drivers.contract.errors import SdkMissingError
from drivers.oak import library
from drivers.oak.address import parse
from drivers.oak.device import OakDevice
from drivers.oak.images.messages import Queue
from drivers.oak.images.picture import Picture
from drivers.oak.source import playback
from drivers.oak.source.connection import Connection
from tests.drivers.conformance.bench import BEFORE, Fault

SAMPLE = Path(__file__).parents[4] / "recordings" / "sample_oak"


class FaultyQueue:
    """A depthai queue with a fault after its first images."""

    def __init__(self, queue: Queue, fault: Fault, connection: Connection) -> None:
        self._queue = queue
        self._fault = fault
        self._connection = connection
        self._count = 0

    def get(self, timeout_s: float) -> Picture | None:
        picture = self._queue.get(timeout_s)
        self._count += picture is not None
        if picture is None or self._count <= BEFORE + 1:
            return picture
        match self._fault:
            case Fault.DROP if self._count % 2:
                return replace(picture, data=picture.data[:100])
            case Fault.STALL:
                return None
            case Fault.UNPLUG:
                self._connection.close()
            case Fault.WRONG_SIZE if self._count % 2:
                return replace(picture, height=picture.height - 2)
            case Fault.NAN if self._count % 2:
                return replace(picture, data=np.zeros_like(picture.data))
        return picture

    def clear(self) -> None:
        self._queue.clear()


class OakBench:
    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open(SAMPLE, fault)

    def open_second(self) -> Device:
        return self._open(self.folder, Fault.NONE)

    def _open(self, folder: Path, fault: Fault) -> Device:
        connection = playback.connect(parse(f"oak://?recording={folder}"), folder)
        queues = {role: FaultyQueue(queue, fault, connection) for role, queue in connection.queues.items()}
        # The end of a recording that is played for ever stands for the loss of a device.
        return OakDevice(replace(connection, queues=queues, ended=""), time.monotonic_ns)


@contextmanager
def bench() -> Iterator[OakBench]:
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(f"{error}, or  make all")
    with tempfile.TemporaryDirectory() as folder:
        second = shutil.copytree(SAMPLE, Path(folder) / "second")
        yield OakBench(second)
