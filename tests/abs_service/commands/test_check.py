import json

import pytest

from abs_service import cli, config
from abs_service.commands import check
from abs_service.commands.parts.checks import device_checks
from abs_service.supervision.exit_codes import Exit
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import write_take

RIG = """
version = 1
name = "bench"
[devices.sim]
uri = "simulated://sheet?seed=1&sensors=tof"
[sensors.tof]
device = "sim"
noise = { type = "gaussian_polynomial", sigma = [[0.005]] }
[synchronisation]
reference = "tof/depth"
[trackers.sheet]
sensors = ["tof"]
model = { type = "rigid" }
"""


@pytest.fixture
def checked(tmp_path, capsys):
    """Checks a configuration; gives the exit code and what was printed."""

    def checked(text, *options):
        path = tmp_path / "rig.toml"
        path.write_text(text)
        code = cli.main(["check", str(path), *options])
        return code, *capsys.readouterr()

    return checked


def test_what_a_configuration_describes(checked, tmp_path):
    code, out, _ = checked(RIG)
    assert code == Exit.OK
    for part in (
        'describes rig "bench"',
        "device   sim: simulated://sheet?seed=1&sensors=tof",
        "sensor   tof: depth 176×144 16UC1 30 Hz, amplitude 176×144 16UC1 30 Hz; noise gaussian_polynomial",
        "tracker  sheet: rigid from tof, vertices by its size in the image; likelihood, hybrid, paced by tof/depth",
        "publishes abs/bench/sheet/state",
        "images: 3 MB/s sent, recorded 3",
        "connect to tcp/127.0.0.1:7447",
        f"records to {tmp_path / 'recordings'}: ",
        " on this disk",
    ):
        assert part in out


@pytest.mark.parametrize(
    ("table", "rates"),
    [
        ("", {"sent_mb_s": 97.1, "recorded_mb_s": [97.1, 97.1]}),
        ('depth_codec = "lossless"\ncolor_codec = "lossless"', {"sent_mb_s": 97.1, "recorded_mb_s": [9.7, 58.3]}),
        ('color_codec = "jpeg"', {"sent_mb_s": 97.1, "recorded_mb_s": [5.1, 25.3]}),
        ("enabled = false", {"sent_mb_s": 97.1, "recorded_mb_s": [0.0, 0.0]}),
    ],
)
def test_bytes_per_second_of_the_images(checked, table, rates):
    sensors = "tof,color,bayer&tof=64x48&color=1280x720&bayer=640x720"
    rig = RIG.replace("sensors=tof", f"sensors={sensors}") + '[sensors.color]\ndevice = "sim"\n[sensors.bayer]\n'
    code, out, _ = checked(rig + f'device = "sim"\n[record]\n{table}\n', "--json")
    assert code == Exit.OK
    sensors = {"tof": 0.4, "color": 82.9, "bayer": 13.8}
    assert json.loads(out)["images"] == {**rates, "sensors_mb_s": sensors, "unknown": []}


def test_streams_that_are_known_once_a_device_is_open(checked):
    rig = RIG.replace("simulated://sheet?seed=1&sensors=tof", "realsense://1")
    code, out, _ = checked(rig)
    assert code == Exit.OK
    assert "images: how much is known once the devices are open" in out


def test_the_same_for_scripts(checked):
    code, out, _ = checked(RIG + "[record]\nenabled = false\n", "--json")
    found = json.loads(out)
    assert (code, found["ok"], found["records"]) == (Exit.OK, True, None)
    assert found["trackers"]["sheet"]["reference"] == "tof/depth"


def test_a_mistake_for_scripts(checked):
    code, out, err = checked(RIG.replace("rigid", "rigit"), "--json")
    found = json.loads(out)
    assert (code, err, found["ok"]) == (Exit.USER, "", False)
    assert 'did you mean "rigid"?' in found["error"]


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        ("simulated://sheet", "simulatde://sheet", 'no such driver, did you mean "simulated"? allowed: '),
        (
            "seed=1&",
            "sede=1&",
            "line 5: devices.sim.uri = \"simulated://sheet?sede=1&sensors=tof\": unknown key 'sede'",
        ),
        ("sensors=tof", "sensors=color", 'devices.sim.uri: sensor "tof": no head "tof", allowed: color'),
        ("sheet?seed=1&sensors=tof", "sheet?seed=x", "seed = 'x' must be a number"),
        (
            "[sensors",
            "[devices.sim.controls]\ngain = 2\n[sensors",
            "devices.sim.controls: gain: no such control, allowed: none",
        ),
        ("simulated://sheet?seed=1&sensors=tof", "replay://none.mcap", "check with --replay FILE"),
        ("simulated://sheet?seed=1&sensors=tof", "kinect1://?stream=ir", "unknown key 'stream'; allowed are"),
        ('"rigid" }', '"rigid" }\nregion = { type = "mask", file = "no.png" }', "trackers.sheet.region: file = "),
        (
            'noise = { type = "gaussian_polynomial", sigma = [[0.005]] }',
            'range_m = 3.0\nnoise = { type = "color" }',
            "sensors.tof.noise: range_m = 3 is for sensors that measure distances",
        ),
        (
            'noise = { type = "gaussian_polynomial", sigma = [[0.005]] }',
            'no_return = { share = 0.1 }\nnoise = { type = "color" }',
            "is for sensors that measure distances",
        ),
    ],
)
def test_what_reads_well_and_cannot_work_is_named(checked, good, bad, message):
    code, out, err = checked(RIG.replace(good, bad))
    assert (code, out) == (Exit.USER, "")
    assert err.startswith("abs-service: error: ")
    assert message in err


def test_all_problems_are_reported_at_once(checked):
    text = RIG.replace("sede", "x").replace("simulated:", "simulatde:")
    text = text.replace('"rigid" }', '"rigid" }\nregion = { type = "mask", file = "no.png" }')
    assert len(checked(text)[2].splitlines()) == 3


def test_no_driver_that_could_touch_hardware_is_opened(monkeypatch, tmp_path):
    monkeypatch.setattr(device_checks, "HARMLESS", frozenset())
    monkeypatch.setattr(device_checks.opening, "open_device", lambda *_: pytest.fail("opened"))
    found = check.describe(config.loads(RIG, "rig.toml", tmp_path), "rig.toml")
    assert found["sensors"]["tof"]["streams"] == []


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ("", "camera from the device"),
        ("[sensors.tof.camera]\nT_rs = {}", "projection from the device, pose from this file"),
    ],
)
def test_the_origin_of_a_camera_is_shown(checked, camera, said):
    assert said in checked(RIG + camera)[1]


def test_a_calibration_file_is_named_with_its_verdict(checked, tmp_path):
    (tmp_path / "x.calibration.toml").write_text(
        'version = 1\nname = "bench"\n[provenance]\ncommand = "abs-service calibrate rig"\ndate = "2026-11-21"\n'
        'version = "0.1.0"\nverdict = "doubtful"\n[sensors.tof.camera]\nT_rs = {}\n'
    )
    given = RIG.replace("[devices.sim]", 'calibration = "x.calibration.toml"\n[devices.sim]')
    out = checked(given)[1]
    assert "calibrated by x.calibration.toml: doubtful, 2026-11-21, abs-service calibrate rig" in out
    assert "projection from the device, pose from x.calibration.toml" in out
    found = json.loads(checked(given, "--json")[1])
    assert found["sensors"]["tof"]["camera"] == {"projection": "device", "pose": "x.calibration.toml"}
    assert found["calibration"]["provenance"]["version"] == "0.1.0"


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """A recording of a depth camera, called "depth"."""
    simulation = parse("simulated://sheet?seed=1&sensors=tof").build()
    return write_take(tmp_path_factory.mktemp("takes") / "take.mcap", simulation, range(3), {"tof": "depth"})


FOR_REPLAY = (
    RIG.replace("simulated://sheet?seed=1&sensors=tof", "replay://not/here.mcap")
    .replace("[sensors.tof]", "[sensors.depth]")
    .replace('"tof"', '"depth"')
    .replace("tof/depth", "depth/depth")
)


def test_a_rig_for_replay_is_checked_against_the_recording_and_not_its_devices(checked, take):
    code, out, _ = checked(FOR_REPLAY, "--replay", str(take))
    assert code == Exit.OK
    assert "sensor   depth: depth 176×144 16UC1" in out
    assert checked(FOR_REPLAY)[0] == Exit.USER


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        ("depth/depth", "depht/depth", 'synchronisation.reference = "depht/depth": no such sensor'),
        (
            "sensors.depth",
            "sensors.other",
            'tracker "sheet" needs sensor "other", which is not there; the recording has: depth',
        ),
        (
            'noise = { type = "gaussian_polynomial", sigma = [[0.005]] }',
            'noise = { type = "color" }',
            "line 11: trackers.sheet: depth: its noise model needs the stream color",
        ),
        ("replay://not/here.mcap", "replay://not/here.mcap?sped=1", "devices.sim.uri = "),
    ],
)
def test_what_a_rig_for_replay_lacks_is_named(checked, take, good, bad, message):
    assert good in FOR_REPLAY
    text = FOR_REPLAY.replace(good, bad)
    if "other" in bad:
        text = text.replace('["depth"]', '["other"]').replace('"depth/depth"', '"other/depth"')
    code, _, err = checked(text, "--replay", str(take))
    assert code == Exit.USER
    assert message in err


def test_a_recording_that_is_not_there_is_named(checked, tmp_path):
    code, _, err = checked(FOR_REPLAY, "--replay", str(tmp_path / "no.mcap"))
    assert code == Exit.USER
    assert f"--replay: {tmp_path / 'no.mcap'}: No such file" in err
