"""`abs-service capture` in this process, with devices that do what a test says."""

import threading
from functools import partial

import pytest

from abs_service import cli
from abs_service.bus.session import SessionMode
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.commands.processes import capture
from abs_service.supervision.exit_codes import Exit
from abs_service.wire.control_commands import set_controls
from drivers.contract.device import DeviceState
from tests.abs_service.capture.fake_device import FakeDevice, adjustable, frame
from tests.waiting import eventually

RIG = """
version = 1
name = "demo"
devices.cam.uri = "replay://any.mcap"
sensors.head.device = "cam"
"""


@pytest.fixture
def captured(tmp_path, endpoint, monkeypatch):
    """Runs it with devices, until `stop` or their end; returns the exit code."""

    def captured(device, stop, *others, rig=RIG):
        (tmp_path / "rig.toml").write_text(rig)
        devices = iter([device, *others])
        monkeypatch.setattr(capture.rig_process, "stop_on_signals", lambda: stop)
        monkeypatch.setattr(capture, "open_device", lambda *_: next(devices))
        monkeypatch.setattr(capture.process_tuning, "freeze_loaded_objects", lambda: None)
        return cli.main(["capture", str(tmp_path / "rig.toml"), "--listen", endpoint])

    return captured


def test_the_exit_code_says_that_the_devices_have_ended(captured):
    def ends(sink):
        sink.on_state(DeviceState.STREAMING, "")
        sink.on_frame(frame())
        sink.on_state(DeviceState.CLOSED, "the recording has ended")

    assert captured(FakeDevice(start=ends), threading.Event()) == Exit.ENDED


def test_what_is_damaged_is_not_opened_again(captured, capfd):
    device = FakeDevice(start=lambda sink: sink.on_state(DeviceState.BROKEN, "any.mcap: a chunk is damaged"))
    assert captured(device, threading.Event()) == Exit.USER
    assert "any.mcap: a chunk is damaged" in capfd.readouterr().err
    assert device.closed.is_set()


def test_the_exit_code_says_that_it_was_told_to_end(captured):
    stop = threading.Event()

    def works(sink):
        sink.on_state(DeviceState.STREAMING, "")
        sink.on_frame(frame())
        stop.set()

    assert captured(FakeDevice(start=works), stop) == Exit.OK


def test_all_devices_are_closed_at_the_same_time(captured):
    stop, started, together, closed = threading.Event(), [], threading.Barrier(2), []

    def works(sink):
        sink.on_state(DeviceState.STREAMING, "")
        started.append(sink)
        if len(started) == 2:
            stop.set()

    devices = FakeDevice(start=works), FakeDevice(start=works)
    for device in devices:
        device.close = lambda: closed.append(together.wait(0.9))
    another = 'devices.other.uri = "replay://any.mcap"\nsensors.other.device = "other"\n'
    assert captured(devices[0], stop, devices[1], rig=RIG + another) == Exit.OK
    assert sorted(closed) == [0, 1]


def test_controls_of_a_device_are_set_while_it_is_captured(captured, endpoint):
    stop, device, answers = threading.Event(), adjustable(), []

    def ask():
        try:
            with ZenohBus.open("demo", endpoint, SessionMode.CLIENT) as bus:
                send = partial(set_controls, bus, "cam", HeaderFactory("demo", WallClock()), 1.0)
                eventually(lambda: (answer := send({})) is not None and answer.accepted)
                answers.append(send({"exposure_s": 0.02}))
        finally:
            stop.set()

    asking = threading.Thread(target=ask)
    begin = device.start
    device.start = lambda sink: (begin(sink), asking.start())
    assert captured(device, stop) == Exit.OK
    asking.join()
    assert answers[0].accepted
    assert device.controls.get("exposure_s") == 0.02


class SetAfterTheFirstLook(threading.Event):
    looks = 0

    def is_set(self):
        was = super().is_set()
        self.looks += 1
        if self.looks == 1:
            self.set()
        return was


def test_a_change_of_the_configuration_just_after_a_look_is_not_missed():
    reconfigured, read = SetAfterTheFirstLook(), []
    for _ in range(3):
        capture.follow(reconfigured, lambda: read.append("rig.toml"))
    assert len(read) == 1


def test_a_configuration_that_changes_while_it_is_read_is_read_again():
    reconfigured, read = threading.Event(), []
    reconfigured.set()

    def configure():
        read.append("rig.toml")
        if len(read) == 1:
            reconfigured.set()

    for _ in range(3):
        capture.follow(reconfigured, configure)
    assert len(read) == 2
