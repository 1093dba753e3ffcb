"""Controls of a device are told, and set, by commands."""

import math

import pytest
from absmsg.v1.command_pb2 import Control, SetControls
from absmsg.v1.common_pb2 import Header

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.wire import commands, control_commands
from drivers.contract.device import DeviceError
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.capture.fake_device import EXPOSURE, adjustable


class Bench:
    """Capture of a device called cam that can be adjusted."""

    def __init__(self):
        self.bus, self.device, self.headers = LoopbackBus(), adjustable(), HeaderFactory("demo", WallClock())
        self.health_bus = LoopbackBus()
        self.health = Health(self.health_bus, "capture", self.headers)
        control_commands.answer_controls(self.bus, "cam", self.headers, self.health, self.act)

    def act(self, values):
        controls = self.device.controls
        for name, value in values.items():
            controls.set(name, value)
        return {info: controls.get(info.name) for info in controls.infos}

    def ask(self, values):
        answer = control_commands.set_controls(self.bus, "cam", self.headers, 1.0, values)
        assert answer is not None
        return answer


def test_all_controls_are_told_with_their_values_and_limits():
    reported = {one.name: one for one in Bench().ask({}).controls}
    assert {name: control_commands.value(one) for name, one in reported.items()} == {
        "auto_exposure": True, "exposure_s": 0.01, "infrared_gain": 12, "sync_role": "free",
    }  # fmt: skip
    exposure = reported["exposure_s"]
    assert (exposure.unit, exposure.minimum, exposure.maximum) == ("s", EXPOSURE.minimum, EXPOSURE.maximum)
    assert list(reported["sync_role"].choices) == ["free", "master"]


def test_values_of_every_type_are_set_and_told():
    bench = Bench()
    wanted = {"exposure_s": 0.02, "auto_exposure": False, "infrared_gain": 3, "sync_role": "master"}
    answer = bench.ask(wanted)
    assert answer.accepted
    assert {one.name: control_commands.value(one) for one in answer.controls} == wanted
    line = health_now(bench.health, bench.health_bus).labels["command"]
    assert line.startswith("cam/controls exposure_s = 0.02 auto_exposure = false infrared_gain = 3")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"exposure_s": 2.0}, "exposure_s = 2.0: must be a number from 0.001 to 0.033 s"),
        ({"exposure_s": math.nan}, "exposure_s = NaN: must be a number from 0.001 to 0.033 s"),
        ({"auto_exposure": "off"}, 'auto_exposure = "off": must be true or false'),
        ({"focus": 1}, "focus: the device has no such control"),
    ],
)
def test_what_a_device_does_not_take_is_refused_with_what_it_takes(values, reason):
    answer = Bench().ask(values)
    assert not answer.accepted
    assert reason in answer.reason


def test_a_device_that_is_gone_is_a_refusal():
    bench = Bench()

    def gone(values):
        raise DeviceError("cam is not open at present")

    control_commands.answer_controls(bench.bus, "cam", bench.headers, bench.health, gone)
    assert bench.ask({}).reason == "cam is not open at present"


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (SetControls(device="cam", controls=[Control(name="exposure_s")]), "no value: exposure_s"),
        (SetControls(device="other"), "belongs to other/controls"),
    ],
)
def test_a_command_that_says_nothing_or_means_another_device_is_refused(command, reason):
    bench = Bench()
    command.header.CopyFrom(Header(rig="demo"))
    (sample,) = bench.bus.command("cam/controls", commands.SET_CONTROLS, command.SerializeToString(), 1.0)
    assert reason in commands.CommandAnswer.FromString(sample.payload).reason
    assert bench.device.controls.get("exposure_s") == 0.01
