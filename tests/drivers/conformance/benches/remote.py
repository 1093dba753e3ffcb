"""Remote rigs, published over zenoh by threads of the test."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np

from abs_service.bus import keys
from abs_service.bus.contract import Subscription
from abs_service.bus.frames import FramePublisher
from abs_service.bus.session import SessionMode
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.capture import sensor_metadata
from abs_service.wire.message_header import CONFIG, MODEL
from drivers.contract.device import Device
from drivers.contract.frame import Frame, Kind
from drivers.opening import open_device
from tests.drivers.conformance.bench import Fault
from tests.drivers.replay.recordings import CAMERAS, SIMULATION
from tests.ports import free_port

RATE_HZ = 60
#: The fault shows so many exposures after the device was opened, which has to subscribe first.
AFTER = 60
LASTS = 20


class Peer:
    """Publishes the frames of one rig, with fault injection."""

    def __init__(self, rig: str, endpoint: str, role: SessionMode) -> None:
        self.bus = ZenohBus.open(rig, endpoint, role, shared_memory=False)
        headers = HeaderFactory(rig, WallClock())
        self.publisher = FramePublisher(self.bus, headers, "sim")
        model = sensor_metadata.sensor_model(headers.now(0), "tof", CAMERAS["tof"], {})
        self.bus.latched_publisher(keys.model("tof"), MODEL).put(model.SerializeToString())
        toml = sensor_metadata.config(headers.now(0), '[sensors.tof]\ndevice = "sim"\n')
        self.bus.latched_publisher(keys.CONFIG, CONFIG).put(toml.SerializeToString())
        self.alive: Subscription = self.bus.declare_liveliness("capture")
        self.frames = [frame for frame in SIMULATION.frames(0) if frame.sensor == "tof"]
        self.fault, self.begin, self.seq, self.epoch = Fault.NONE, 0, 0, 5_000
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self._run, name="peer")
        self.thread.start()

    def arm(self, fault: Fault) -> None:
        """Activates a fault."""
        self.begin, self.fault = self.seq + AFTER, fault

    def heal(self) -> None:
        """Resumes publishing after a fault."""
        if self.fault == Fault.UNPLUG:
            self.alive.close()
            self.alive = self.bus.declare_liveliness("capture")
        self.fault = Fault.NONE

    def close(self) -> None:
        self.stop.set()
        self.thread.join()
        self.publisher.close()
        self.bus.close()

    def _run(self) -> None:
        while not self.stop.wait(1 / RATE_HZ):
            self.seq += 1
            elapsed = self.seq - self.begin
            fault = self.fault if elapsed >= 0 else Fault.NONE
            if fault == Fault.UNPLUG and elapsed == 0:
                self.alive.close()
            lost = fault == Fault.DROP and elapsed < LASTS and elapsed % 2 == 0
            if fault in {Fault.STALL, Fault.UNPLUG} or lost:
                continue
            for frame in self.frames:
                self.publisher.on_frame(self._now(frame, fault if elapsed < LASTS else Fault.NONE))

    def _now(self, frame: Frame, fault: Fault) -> Frame:
        now_ns = time.monotonic_ns()
        data = frame.data
        if fault == Fault.WRONG_SIZE:
            data = data[:-1]
        if fault == Fault.NAN and frame.kind == Kind.DEPTH:
            data = np.zeros_like(data)
        return replace(frame, data=data, seq=self.seq, epoch=self.epoch, t_host_ns=now_ns, t_arrival_ns=now_ns)


class RemoteBench:
    def __init__(self, port: int) -> None:
        endpoint = f"tcp/127.0.0.1:{port}"
        self.port = port
        self.first = Peer("bench", endpoint, SessionMode.ROUTER)
        self.second = Peer("other", endpoint, SessionMode.CLIENT)

    def open(self, fault: Fault = Fault.NONE) -> Device:
        self.first.heal()
        device = self._open("bench")
        self.first.arm(fault)
        return device

    def open_second(self) -> Device:
        return self._open("other")

    def close(self) -> None:
        self.second.close()
        self.first.close()

    def _open(self, rig: str) -> Device:
        uri = f"remote://127.0.0.1:{self.port}/{rig}?shared_memory=0&learn=0.3"
        return open_device(uri, time.monotonic_ns)


@contextmanager
def bench() -> Iterator[RemoteBench]:
    bench = RemoteBench(free_port())
    try:
        yield bench
    finally:
        with suppress(Exception):
            bench.close()
