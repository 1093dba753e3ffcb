"""`abs-service devices` says what is attached, what to do about what cannot be used, and who comes and goes."""

import json
import math
from importlib import resources
from pathlib import Path

import pytest

from abs_service import cli
from abs_service.commands import devices
from abs_service.supervision.exit_codes import Exit
from drivers import opening
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls
from drivers.contract.device import DeviceInfo
from drivers.contract.discovery import Availability, Found
from tests.abs_service.capture.fake_device import FakeDevice

OAK = Found(DeviceInfo("oak://184430", "OAK-D ToF", "184430", "1.2.3", "USB 3, 5 Gbit/s"))
KINECT = Found(
    DeviceInfo("kinect1://A0036", "Kinect for Xbox 360", "A0036", "1.0b", "USB 2, 480 Mbit/s"),
    Availability.NO_PERMISSION,
    "you may not open it",
    "abs-service devices --udev",
)
NO_SDK = Found(
    DeviceInfo("realsense://", "RealSense", ""),
    Availability.SDK_MISSING,
    "pyrealsense2 is not installed",
    ".venv/bin/pip install -e '.[realsense]'",
)


@pytest.fixture
def listed(monkeypatch, capsys):
    """Runs the command with some devices attached; gives what was printed."""

    def listed(*found, options=()):
        monkeypatch.setattr(opening, "discover", lambda timeout_s: list(found))
        monkeypatch.setenv("COLUMNS", "120")
        assert cli.main(["devices", *options]) == Exit.OK
        return capsys.readouterr().out

    return listed


def test_every_device_is_listed_with_what_to_do_about_it(listed):
    lines = listed(KINECT, NO_SDK, OAK).splitlines()
    assert lines[1].split() == ["oak://184430", "OAK-D", "ToF", "184430", "1.2.3", "USB", "3,", "5", "Gbit/s", "ready"]
    assert lines[2].startswith("kinect1://A0036")
    assert lines[2].rstrip().endswith("no permission")
    text = "\n".join(lines)
    assert "kinect1://A0036: you may not open it\n  abs-service devices --udev" in text
    assert "realsense://  pyrealsense2 is not installed:  .venv/bin/pip install -e '.[realsense]'" in text


def test_an_empty_table_shows_what_works_without_a_camera(listed):
    text = listed(NO_SDK)
    assert "No camera is attached." in text
    assert "`abs-service run` needs none" in text


def test_the_same_for_scripts(listed):
    first, second = json.loads(listed(OAK, KINECT, options=["--json"]))["devices"]
    assert first["uri"] == "oak://184430"
    assert (first["state"], first["link"], first["firmware"]) == ("ready", "USB 3, 5 Gbit/s", "1.2.3")
    assert (second["state"], second["remedy"]) == ("no permission", "abs-service devices --udev")


def test_who_comes_goes_and_changes():
    ready = Found(KINECT.info)
    assert list(devices.changes([], [OAK])) == [("+", OAK)]
    assert list(devices.changes([OAK], [KINECT])) == [("-", OAK), ("+", KINECT)]
    assert list(devices.changes([KINECT, OAK], [OAK, ready])) == [("~", ready)]
    assert list(devices.changes([OAK], [OAK])) == []


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_hot_plug_is_followed_until_interrupted(monkeypatch, capsys, options):
    looks = iter([[OAK], [], [KINECT]])
    stop = devices.rig_process.stop_on_signals()

    def discover(timeout_s):
        found = next(looks)
        if found == [KINECT]:
            stop.set()
        return found

    monkeypatch.setattr(devices, "PERIOD_S", 0.0)
    monkeypatch.setattr(devices.rig_process, "stop_on_signals", lambda: stop)
    monkeypatch.setattr(opening, "discover", discover)
    assert cli.main(["devices", "--watch", *options]) == Exit.OK
    lines = [line for line in capsys.readouterr().out.splitlines() if not line.startswith("Watching")]
    if options:
        events = [json.loads(line) for line in lines]
        assert [(event["event"], event["device"]["serial"]) for event in events] == [
            ("added", "184430"),
            ("removed", "184430"),
            ("added", "A0036"),
        ]
    else:
        assert [line[:14] for line in lines] == ["+ oak://184430", "- oak://184430", "+ kinect1://A0"]


def test_one_device_is_described_with_its_controls(monkeypatch, capsys):
    device = FakeDevice()
    exposure = ControlInfo("exposure_s", ControlKind.NUMBER, "s", 1e-5, 0.03)
    switch = ControlInfo("auto_exposure", ControlKind.SWITCH)
    device.controls = Controls([Control(exposure, lambda: 0.01, print), Control(switch, lambda: True, print)])
    monkeypatch.setattr(opening, "open_device", lambda uri, clock: device)
    monkeypatch.setenv("COLUMNS", "120")
    assert cli.main(["devices", "fake://1"]) == Exit.OK
    text = capsys.readouterr().out
    assert "head/image  4 × 3  mono8" in text
    assert "exposure_s     0.01  a number from 1e-05 to 0.03 s" in text
    assert device.closed.is_set()
    assert cli.main(["devices", "fake://1", "--json"]) == Exit.OK
    described = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert [control["value"] for control in described["controls"]] == [0.01, True]
    assert described["controls"][0]["maximum"] == 0.03
    assert not any(value == math.inf for value in described["controls"][1].values())


def test_a_malformed_address_is_explained(capsys):
    assert cli.main(["devices", "camera://1"]) == Exit.USER
    assert "scheme 'camera' is none of" in capsys.readouterr().err


def test_the_rules_cover_every_usb_camera_that_there_is_a_driver_for(capsys):
    assert cli.main(["devices", "--udev"]) == Exit.OK
    rules = capsys.readouterr().out
    for number in ("045e", "02ae", "02bf", "02b0", "02ad", "03e7", "8086"):
        assert f'=="{number}"' in rules
    beside = Path(__file__).parents[3] / "docker" / "60-abs-service.rules"
    assert (
        beside.read_text() == rules == resources.files("drivers.contract").joinpath("60-abs-service.rules").read_text()
    )
