"""A driver that does not return, from opening or from a command, is said, and holds up as little as possible.

So is a device that can be opened, and delivers nothing.
"""

import threading
from dataclasses import replace

import pytest
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture import device_supervisor
from abs_service.capture.device_supervisor import DeviceSupervisor
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.device import DeviceError, DeviceState
from drivers.contract.frame import Kind
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.capture.fake_device import FakeDevice, failing, frame, working
from tests.waiting import eventually


class Supervised:
    """A supervisor of devices that are opened one after the other, and a sink that counts their frames."""

    def __init__(self, *makers):
        remaining = iter(makers)
        self.frames = 0
        self.late_ns = 0
        wall, self.bus = WallClock(), LoopbackBus()
        self.health = Health(self.bus, "capture", HeaderFactory("demo", wall))
        self.supervisor = DeviceSupervisor(
            *("sim", "fake://", lambda uri: next(remaining)(), lambda device: None, self, {"head": "tof"}),
            self.health,
            lambda: wall.monotonic() + self.late_ns,
        )
        self.supervisor.start()

    def on_frame(self, frame):
        self.frames += 1

    def on_truth(self, truth):
        pass

    def on_state(self, state, reason):
        pass

    def on_warning(self, condition, message):
        pass

    @property
    def said(self):
        self.supervisor.check()
        return health_now(self.health, self.bus)


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Neither commands nor failed devices are waited for long."""
    monkeypatch.setattr(device_supervisor, "COMMAND_S", 0.05)
    monkeypatch.setattr(device_supervisor, "FIRST_BACKOFF_S", 0.05)


@pytest.fixture
def go_on():
    """Lets what hangs go on; set at the end of the test."""
    event = threading.Event()
    yield event
    event.set()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_device_whose_thread_has_ended_ends_the_process_that_run_starts_again(monkeypatch):
    def lacks_memory(*_):
        raise MemoryError

    supervised = Supervised(failing(DeviceError("unplugged")))
    monkeypatch.setattr(supervised.health, "count", lacks_memory)

    def is_noticed():
        supervised.supervisor.check()
        return "its thread has ended" in str(supervised.supervisor.fatal_error)

    assert eventually(is_noticed)


def test_a_command_that_hangs_keeps_neither_the_device_from_reopening_nor_the_next_command_from_an_answer(go_on):
    sinks, hangs = [], threading.Event()

    def start(sink):
        sinks.append(sink)
        sink.on_state(DeviceState.STREAMING, "")
        sink.on_frame(frame())

    def hang(_):
        hangs.set()
        go_on.wait(20)

    rig = Supervised(lambda: FakeDevice(start=start), working)
    assert eventually(lambda: rig.frames)
    threading.Thread(target=rig.supervisor.use, args=(hang,)).start()
    assert hangs.wait(5)
    with pytest.raises(DeviceError, match="sim has not returned from the command before this one"):
        rig.supervisor.use(lambda device: None)
    sinks[0].on_state(DeviceState.FAILED, "unplugged")
    assert eventually(lambda: rig.frames == 2)
    assert eventually(lambda: rig.said.labels["device.sim"] == "streaming")
    assert rig.supervisor.use(lambda device: device.info.serial) == "1"
    rig.supervisor.close(5)


def test_a_driver_that_hangs_is_an_error_until_it_returns(go_on):
    def slow():
        go_on.wait(20)
        return working()

    rig = Supervised(failing("unplugged"), slow)
    assert eventually(lambda: rig.said.message == "sim: unplugged; opened again, waits for its images")
    rig.late_ns = 31 * 10**9
    assert "sim: its driver has not returned for 31 s; end `capture`, which `run` starts again" in rig.said.message
    go_on.set()
    assert eventually(lambda: rig.said.level == Message.LEVEL_OK)
    rig.supervisor.close(5)


def test_a_device_that_is_opened_again_is_an_error_until_all_its_streams_deliver():
    sinks = []

    def silent():
        device = FakeDevice(start=lambda sink: (sink.on_state(DeviceState.STREAMING, ""), sinks.append(sink)))
        device.capabilities = Capabilities(
            tuple(StreamInfo("head", name, Kind.COLOR, "mono8", 4, 3, 30.0) for name in ("image", "infrared"))
        )
        return device

    rig = Supervised(failing("unplugged"), silent)
    assert eventually(lambda: rig.said.labels["device.sim"] == "streaming" and sinks)
    words = "sim: unplugged; opened again, waits for its images"
    assert (rig.said.level, rig.said.message) == (Message.LEVEL_ERROR, words)
    sinks[0].on_frame(frame())
    assert eventually(lambda: rig.frames == 2)
    assert (rig.said.level, rig.said.message) == (Message.LEVEL_ERROR, words)
    sinks[0].on_frame(replace(frame(), stream="infrared"))
    assert eventually(lambda: rig.said.level == Message.LEVEL_OK)
    rig.supervisor.close(5)


def test_a_warning_ends_with_the_device_that_gave_it():
    sinks = []

    def dark():
        return FakeDevice(start=lambda sink: (sink.on_state(DeviceState.STREAMING, ""), sinks.append(sink)))

    rig = Supervised(dark, working)
    assert eventually(lambda: sinks)
    sinks[0].on_frame(frame())
    sinks[0].on_warning("head/image empty", "nothing in its images")
    assert eventually(lambda: rig.said.message == "sim: nothing in its images")
    sinks[0].on_state(DeviceState.FAILED, "unplugged")
    assert eventually(lambda: rig.frames == 2)
    assert eventually(lambda: rig.said.level == Message.LEVEL_OK)
    rig.supervisor.close(5)
