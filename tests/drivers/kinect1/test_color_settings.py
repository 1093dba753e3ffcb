"""Automatic colours are told, and exposures where they are known."""

import math

import pytest

from drivers.kinect1.camera import Stream
from drivers.kinect1.color_settings import CONDITION
from evaluation.service.kinect1_emulation.emulated_camera import noise
from tests.drivers.kinect1.fake_usb import FakeDevice
from tests.drivers.kinect1.test_device import SERIAL, opened
from tests.drivers.recording_sink import RecordingSink


def test_automatic_colours_warn_until_they_are_off_and_exposures_are_told_then() -> None:
    fake = FakeDevice(noise(), SERIAL)
    fake.kinect.color_sensor[0x106] = 1 << 14 | 1 << 1
    device, sink = opened(fake, (Stream.COLOR,)), RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= 1)
    condition, message = sink.warnings[-1]
    assert condition == CONDITION
    assert message.startswith("auto_exposure and auto_white_balance on")
    device.controls.set("auto_white_balance", False)
    assert sink.warnings[-1][1].startswith("auto_exposure on")
    device.controls.set("exposure_s", 0.02)
    device.controls.set("auto_exposure", False)
    assert sink.warnings[-1] == (CONDITION, "")
    count = len(sink.frames)
    sink.wait(lambda: len(sink.frames) >= count + 2)
    device.close()
    first, last = sink.frames[0], sink.frames[-1]
    assert math.isnan(first.exposure_s)
    assert last.exposure_s == pytest.approx(0.02, abs=1e-4)
    assert last.at_middle().t_host_ns == last.t_host_ns - round(0.5e9 * last.exposure_s)
