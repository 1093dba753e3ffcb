"""Devices are set as a rig says."""

import pytest

from abs_service.commands.parts import rig_devices
from abs_service.commands.parts.rig_devices import SettingError
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls
from tests.abs_service.capture.fake_device import FakeDevice


def test_a_control_is_set_at_every_opening_and_a_wrong_one_is_explained():
    held = {}
    info = ControlInfo("exposure_s", ControlKind.NUMBER, "s", 1e-5, 0.03)
    device = FakeDevice()
    device.controls = Controls([Control(info, lambda: 0.0, lambda value: held.update(exposure_s=value))])
    rig_devices.set_controls(device, {"exposure_s": 0.01}, "rig.toml: devices.cam.controls")
    assert held == {"exposure_s": 0.01}
    expected = r"^rig\.toml: devices\.cam\.controls\.exposure_s = 5: must be a number from 1e-05 to 0\.03 s$"
    with pytest.raises(SettingError, match=expected):
        rig_devices.set_controls(device, {"exposure_s": 5}, "rig.toml: devices.cam.controls")
    with pytest.raises(SettingError, match=r"controls\.gain: the device has no such control, it has: exposure_s"):
        rig_devices.set_controls(device, {"gain": 5}, "rig.toml: devices.cam.controls")
