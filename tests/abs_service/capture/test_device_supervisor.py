"""Devices are kept delivering, under the names of the rig."""

import queue
import threading
import time
from types import MappingProxyType

import pytest
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture import device_supervisor, stall_detector
from abs_service.capture.device_supervisor import DeviceSupervisor
from abs_service.commands.parts.rig_devices import HeadError
from drivers.contract.device import AddressError, DeviceError, DeviceState
from drivers.simulated import open_device
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.capture.fake_device import FakeDevice, failing, frame, working
from tests.waiting import eventually


class Collector:
    """A sink that keeps everything."""

    def __init__(self):
        self.frames = queue.SimpleQueue()

    def on_frame(self, frame):
        self.frames.put(frame)

    def on_truth(self, truth):
        pass

    def on_state(self, state, reason):
        pass

    def on_warning(self, condition, message):
        pass


@pytest.fixture
def asked():
    """The addresses that supervisors have opened."""
    return []


@pytest.fixture
def keep(monkeypatch, asked):
    """Starts a supervisor on devices that are made one after the other; closed after the test."""
    monkeypatch.setattr(device_supervisor, "FIRST_BACKOFF_S", 0.1)
    supervisors = []

    def keep(*make, on_open=lambda device: None, heads=MappingProxyType({"head": "tof"})):
        makers = iter(make)
        collector, bus = Collector(), LoopbackBus()
        health = Health(bus, "capture", HeaderFactory("demo", WallClock()))

        def open_device(uri):
            asked.append(uri)
            return next(makers)()

        supervisor = DeviceSupervisor(
            "sim", "fake://", open_device, on_open, collector, heads, health, WallClock().monotonic
        )
        supervisors.append(supervisor)
        supervisor.start()
        return supervisor, collector, lambda: health_now(health, bus)

    yield keep
    for supervisor in supervisors:
        supervisor.close(5)


@pytest.fixture
def soon_silent(monkeypatch):
    """A device is stalled after 0.2 s, and opened again after 0.6 s."""
    monkeypatch.setattr(stall_detector, "STALL_NS", 200_000_000)
    monkeypatch.setattr(stall_detector, "REOPEN_NS", 600_000_000)


def no_device():
    raise DeviceError("no such device; plug it in")


def test_a_failed_device_is_opened_again_in_a_later_epoch(keep):
    _, collector, health = keep(failing("unplugged"), working)
    first, second = collector.frames.get(timeout=5), collector.frames.get(timeout=5)
    assert (first.sensor, second.sensor) == ("tof", "tof")
    assert second.epoch > first.epoch
    assert eventually(lambda: health().level == Message.LEVEL_OK)
    assert health().counters["device.sim.reconnects"] == 1
    assert eventually(lambda: health().counters["device.sim.frames"] == 2), "both devices count one frame"
    assert eventually(lambda: health().labels["device.sim"] == "streaming")


def test_a_device_error_is_reported_until_the_device_can_be_opened(keep):
    _, collector, health = keep(no_device, working)
    assert eventually(lambda: health().level == Message.LEVEL_ERROR)
    assert health().message == "sim: no such device; plug it in; trying again in 0.2 s"
    assert collector.frames.get(timeout=5)
    assert eventually(lambda: health().level == Message.LEVEL_OK)


def test_an_address_that_no_device_can_have_is_refused(keep):
    def misspelt():
        raise AddressError("simulated://shet: there is no such scene")

    supervisor, collector, _ = keep(misspelt, working)
    assert eventually(lambda: isinstance(supervisor.fatal_error, AddressError))
    assert collector.frames.empty()


def test_a_mistake_of_a_driver_is_a_failure_like_any_other(keep, caplog):
    def broken():
        raise ZeroDivisionError("a mistake")

    _, collector, _ = keep(broken, working)
    assert collector.frames.get(timeout=5)
    assert "ZeroDivisionError" in caplog.text


@pytest.mark.usefixtures("soon_silent")
def test_a_device_that_falls_silent_is_stalled_and_then_opened_again(keep):
    _, collector, health = keep(working, working)
    first = collector.frames.get(timeout=5)
    assert eventually(lambda: health().labels["device.sim"] == "stalled")
    assert health().level == Message.LEVEL_WARNING
    assert "head/image delivers nothing for" in health().message
    assert collector.frames.get(timeout=5).epoch > first.epoch
    assert health().counters["device.sim.stalls"] >= 1


def test_only_the_same_serial_number_is_accepted_after_a_reconnect(keep, asked):
    def other():
        return FakeDevice(start=working().start, serial="2")

    _, collector, health = keep(failing("unplugged"), other, working)
    collector.frames.get(timeout=5)
    assert eventually(lambda: "is device 2 now; 1 is awaited" in health().message)
    assert collector.frames.get(timeout=5)
    assert asked == ["fake://", "fake://1", "fake://1"], "by its serial number, though the address has none"


def test_warnings_and_gauges_of_a_device_are_in_the_health(keep):
    device = working()
    device.gauges = {"temperature_c": 41.5}
    device.start = lambda sink: (
        sink.on_state(DeviceState.STREAMING, ""),
        sink.on_frame(frame()),
        sink.on_warning("usb speed", "USB 2 only; use a blue port"),
        sinks.append(sink),
    )
    sinks = []
    _, _, health = keep(lambda: device)
    assert eventually(lambda: health().level == Message.LEVEL_WARNING)
    assert health().message == "sim: USB 2 only; use a blue port"
    assert health().gauges["device.sim.temperature_c"] == 41.5
    sinks[0].on_warning("usb speed", "")
    assert eventually(lambda: health().level == Message.LEVEL_OK)


def test_a_device_that_does_not_answer_when_it_is_set_is_tried_again(keep):
    calls = []

    def on_open(device):
        calls.append(device)
        if len(calls) == 1:
            raise DeviceError("does not answer")

    supervisor, collector, _ = keep(working, working, on_open=on_open)
    assert collector.frames.get(timeout=5)
    assert supervisor.fatal_error is None


def test_frames_of_heads_that_are_not_configured_are_counted_and_dropped(keep):
    device = FakeDevice(start=lambda sink: [sink.on_frame(frame(sensor)) for sensor in ("other", "other", "head")])
    _, collector, health = keep(lambda: device)
    assert collector.frames.get(timeout=5).sensor == "tof"
    assert eventually(lambda: health().counters["device.sim.unwanted"] == 2)
    assert collector.frames.empty()


def test_a_device_at_its_end_is_not_opened_again(keep):
    device = FakeDevice(start=lambda sink: sink.on_state(DeviceState.CLOSED, "end of the recording"))
    supervisor, _, health = keep(lambda: device)
    assert eventually(lambda: supervisor.finished)
    assert device.closed.wait(5)
    assert health().level == Message.LEVEL_OK


def test_a_device_that_does_not_fit_is_refused_and_closed(keep):
    device = FakeDevice()

    def refuse(_):
        raise HeadError("no such head")

    supervisor, _, _ = keep(lambda: device, on_open=refuse)
    assert eventually(lambda: supervisor.fatal_error)
    assert device.closed.wait(5)


def test_a_device_that_opens_after_the_end_is_closed_and_not_announced(keep):
    asked_for, open_now, announced = threading.Event(), threading.Event(), []
    device = FakeDevice()

    def slow():
        asked_for.set()
        open_now.wait(5)
        return device

    supervisor, _, health = keep(slow, on_open=announced.append)
    assert asked_for.wait(5)
    supervisor.close(0.01)
    open_now.set()
    assert device.closed.wait(5)
    assert not announced
    assert supervisor.fatal_error is None
    assert health().level == Message.LEVEL_OK


def test_what_fails_after_the_end_is_no_error_of_the_rig(keep):
    asked_for, fail_now, device = threading.Event(), threading.Event(), FakeDevice()

    def announce(_):
        asked_for.set()
        fail_now.wait(5)
        raise RuntimeError("session closed")

    supervisor, _, _ = keep(lambda: device, on_open=announce)
    assert asked_for.wait(5)
    supervisor.close(0.01)
    fail_now.set()
    assert device.closed.wait(5)
    assert supervisor.fatal_error is None


@pytest.mark.usefixtures("soon_silent")
def test_a_frozen_camera_is_opened_again_and_counted(keep):
    def frozen():
        return open_device("simulated://sheet?sensors=tof&tof=32x24&fault=freeze@5", time.monotonic_ns)

    _, collector, health = keep(frozen, frozen, heads={"tof": "tof"})
    first = collector.frames.get(timeout=20)
    assert eventually(lambda: health().labels["device.sim"] == "stalled")
    assert "delivers the same image for" in health().message
    assert eventually(lambda: health().counters["device.sim.reconnects"] == 1)
    assert eventually(lambda: collector.frames.get(timeout=5).epoch > first.epoch)
    assert health().counters["device.sim.repeated"] > 5
