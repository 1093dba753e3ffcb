"""The device supervisor reopens an unplugged device of every driver: same device, later epoch."""

import pytest

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture import device_supervisor
from abs_service.capture.device_supervisor import DeviceSupervisor
from drivers.contract.device import Device
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.drivers.conformance.bench import Bench, Fault
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually


def test_an_unplugged_device_is_reopened_in_a_later_epoch(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_supervisor, "FIRST_BACKOFF_S", 0.1)
    opened: list[tuple[str, str]] = []
    faults = iter([Fault.UNPLUG])

    def open_device(uri: str) -> Device:
        device = bench.open(next(faults, Fault.NONE))
        opened.append((uri, device.info.uri))
        heads.update({stream.sensor: stream.sensor for stream in device.capabilities.streams})
        return device

    heads: dict[str, str] = {}
    sink, clock = RecordingSink(), WallClock()
    bus = LoopbackBus()
    health = Health(bus, "capture", HeaderFactory("demo", clock))
    supervisor = DeviceSupervisor(
        "cam", "any://", open_device, lambda device: None, sink, heads, health, clock.monotonic
    )
    supervisor.start()
    try:
        assert eventually(lambda: len({frame.epoch for frame in list(sink.frames)}) == 2)
        assert sink.receives(2)
    finally:
        supervisor.close(10)
    epochs = [frame.epoch for frame in sink.frames]
    assert epochs == sorted(epochs)
    counters = health_now(health, bus).counters
    assert counters["device.cam.reconnects"] == 1
    assert opened[0][0] == "any://"
    assert opened[1][0] == opened[0][1], "by the address of this very device, whatever the first one left open"
    assert counters["device.cam.frames"] >= len(sink.frames)
