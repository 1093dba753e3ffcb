"""Controls that users set outlast a new opening of the device."""

import time
from functools import partial

import pytest

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture.device_supervisor import DeviceSupervisor
from abs_service.capture.requested_controls import RequestedControls
from drivers.contract.controls import Controls
from drivers.contract.device import ControlError, DeviceError
from tests.abs_service.bus.loopback import LoopbackBus
from tests.abs_service.capture.fake_device import FakeDevice, adjustable
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually


def test_values_are_set_again_in_the_order_in_which_they_were_asked_for():
    asked, opened_again = RequestedControls(), adjustable()
    asked.set({"auto_exposure": False, "infrared_gain": 5}, adjustable())
    asked.set({"exposure_s": 0.02}, adjustable())
    asked.set({"auto_exposure": True}, adjustable())
    asked.renew(opened_again)
    values = {info.name: opened_again.controls.get(info.name) for info in opened_again.controls.infos}
    assert values == {"auto_exposure": True, "exposure_s": 0.02, "infrared_gain": 5, "sync_role": "free"}


def test_what_was_refused_is_not_asked_for_again(caplog):
    asked, opened_again = RequestedControls(), adjustable()
    with pytest.raises(ControlError):
        asked.set({"exposure_s": 7.0}, adjustable())
    asked.renew(opened_again)
    assert opened_again.controls.get("exposure_s") == 0.01
    assert not caplog.text


def test_a_control_that_is_gone_is_logged_and_does_not_end_the_device(caplog):
    asked, opened_again = RequestedControls(), adjustable()
    asked.set({"infrared_gain": 5}, adjustable())
    opened_again.controls = Controls()
    asked.renew(opened_again)
    assert "infrared_gain: the device has no such control" in caplog.text


def test_a_device_is_set_while_it_is_open_and_not_after():
    device, health = adjustable(), Health(LoopbackBus(), "capture", HeaderFactory("demo", WallClock()))
    device.start = FakeDevice().start
    make = partial(DeviceSupervisor, "cam", "fake://", lambda _: device, lambda _: None)
    supervisor = make(RecordingSink(), {}, health, time.monotonic_ns)
    ask = partial(supervisor.use, partial(RequestedControls().set, {"infrared_gain": 5}))

    def refused():
        try:
            return ask() and False
        except DeviceError as error:
            return str(error) == "cam is not open at present"

    assert refused()
    supervisor.start()
    assert eventually(lambda: not refused())
    assert device.controls.get("infrared_gain") == 5
    supervisor.close(5)
    assert refused()
