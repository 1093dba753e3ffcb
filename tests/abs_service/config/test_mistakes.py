"""Mistakes in a rig file are named with line, key, value and the allowed values, all at once."""

import re
from pathlib import Path

import pytest

from abs_service import config
from abs_service.config import references
from abs_service.tracker.measurements import measurement
from tests.abs_service.config.sensors_file import SENSORS, loads


def mistakes(text: str) -> list[str]:
    with pytest.raises(config.ConfigError) as caught:
        loads(text)
    first, *others = str(caught.value).splitlines()
    assert first.startswith("rig.toml: ")
    return [re.sub(r"^line \d+: ", "", line.strip()) for line in others or [first.removeprefix("rig.toml: ")]]


CASES = {
    "a misspelt section": ("[buss]\n", 'buss: unknown key, did you mean "bus"?'),
    "a misspelt key": (
        "[record]\nrotate_sec = 3\n",
        'record.rotate_sec: unknown key, did you mean "rotate_s"? allowed: begin, chunk',
    ),
    "a path with a zero byte": ('[record]\ndirectory = "a\\u0000b"\n', "whose names have no zero byte"),
    "a path with a name too long": (
        f'[record]\ndirectory = "{"x" * 300}"\n',
        "whose names have no zero byte and at most 255 bytes",
    ),
    "a path too long": (f'[record]\ndirectory = "{"d/" * 2500}"\n', "must be a path of at most 4095 bytes"),
    "a path in a home folder": ('[record]\ndirectory = "~/takes"\n', '"~" is not replaced by a home folder'),
    "a value out of range": ("[record]\nflush_s = 0\n", "record.flush_s = 0: must be greater than 0"),
    "a time that no clock counts to": (
        "[record]\nflush_s = 1e300\n",
        "record.flush_s = 1e+300: must be less than or equal to 1000000000",
    ),
    "a time offset that no clock counts to": (
        '[sensors.ir]\ndevice = "sim"\ntime_offset_ms = -1e300\n',
        "sensors.ir.time_offset_ms = -1e+300: must be greater than or equal to -1000000000000",
    ),
    "a stall that each process would be": (
        "[run]\nstall_timeout_s = 1.0\n",
        "run.stall_timeout_s = 1.0: must be greater than or equal to 2",
    ),
    "a number as text": ('[record]\nflush_s = "1"\n', 'record.flush_s = "1": must be a valid number'),
    "a value that is none of those allowed": (
        '[record]\ncompression = "gzip"\n',
        "record.compression = \"gzip\": must be 'none', 'lz4' or 'zstd'",
    ),
    "an endpoint without a port": ('[bus]\nendpoint = "tcp/here"\n', "an endpoint is protocol/address:port"),
    "an endpoint with priorities": ('[bus]\nendpoint = "tcp/127.0.0.1:7447?prio=0-99"\n', "without ?"),
    "mutual TLS on an endpoint without": (
        '[bus.tls]\nauthority = "a"\ncertificate = "b"\nkey = "c"\n',
        "must begin with tls/, because there is a table [bus.tls]",
    ),
    "an endpoint with too high a port": (
        '[bus]\nendpoint = "tcp/here:70000"\n',
        "an endpoint is protocol/address:port",
    ),
    "a device without a driver": ('[devices.x]\nuri = "sheet"\n', 'devices.x.uri = "sheet": a device URI begins with'),
    "a sensor without its device": (
        '[sensors.ir]\ndevice = "sam"\n',
        'sensors.ir.device = "sam": no such device, did you mean "sim"? allowed: sim',
    ),
    "a head that two sensors claim": (
        '[sensors.second]\ndevice = "sim"\nhead = "rgb"\n',
        'sensors.second: sensor "color" is head "rgb" of device "sim" already',
    ),
    "a name that cannot be a key": ('[devices."a/b"]\nuri = "simulated://sheet"\n', "devices.a/b = "),
    "a reserved name": ('[devices.health]\nuri = "simulated://sheet"\n', "reserved"),
    "a pose that is none": (
        "[sensors.tof.camera]\nT_rs = [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
        "sensors.tof.camera.T_rs = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]: not a pose",
    ),
    "a pose of words": ('[sensors.tof.camera]\nT_rs = [["a"]]\n', "4 rows of 4 numbers"),
    "half a camera matrix": ("[sensors.tof.camera]\nfx = 3.0\n", "missing: width, height, fy, cx, cy"),
    "a lens without its camera matrix": ("[sensors.tof.camera]\nlens = [0.1]\n", "missing: width"),
    "a lens model without its camera matrix": ('[sensors.tof.camera]\nlens_model = "fisheye"\n', "missing: width"),
    "a lens model that is none": (
        '[sensors.tof.camera]\nlens_model = "fish"\n',
        "sensors.tof.camera.lens_model = \"fish\": must be 'brown_conrady' or 'fisheye'",
    ),
    "too many coefficients of a fisheye": (
        "[sensors.tof.camera]\nwidth = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 16.0\ncy = 12.0\n"
        'lens_model = "fisheye"\nlens = [0, 0, 0, 0, 1]\n',
        "a lens has at most 4 finite coefficients ('k1', 'k2', 'k3', 'k4'), not [0.0, 0.0, 0.0, 0.0, 1.0]",
    ),
    "a noise model that is none": (
        '[sensors.ir]\ndevice = "sim"\nnoise = { type = "colour" }\n',
        'sensors.ir.noise.type = "colour": no such type, did you mean "color"? allowed: bayer, binary, color,',
    ),
    "a share of outliers that leaves nothing": (
        '[sensors.ir]\ndevice = "sim"\noutlier_share = 1.0\n',
        "sensors.ir.outlier_share = 1.0: must be less than 1",
    ),
    "a sensor that returns less than never": (
        '[sensors.ir]\ndevice = "sim"\nno_return = { grazing = -1.0 }\n',
        "sensors.ir.no_return.grazing = -1.0: must be greater than or equal to 0",
    ),
    "a noise model's key": (
        '[sensors.ir]\ndevice = "sim"\nnoise = { type = "color", sigm = 3 }\n',
        'sensors.ir.noise.sigm: unknown key, did you mean "sigma"? allowed: sigma',
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_named_with_its_key_its_value_and_what_is_allowed(case):
    text, message = CASES[case]
    found = mistakes(SENSORS + text)
    assert len(found) == 1
    assert message in found[0]


def test_all_problems_are_reported_at_once():
    text = (
        SENSORS.replace('device = "sim"', 'device = "sam"').replace("version = 1", "version = 2").replace("[bus]", "")
    )
    found = mistakes(text + "[bus]\nendpoint = 3\n")
    assert [line.split()[0] for line in found] == [
        "version",
        "sensors.tof.device",
        "sensors.color.device",
        "bus.endpoint",
    ]


def test_each_problem_says_on_which_line_it_is():
    text = SENSORS.replace('device = "sim"', 'device = "sam"', 1) + "[record]\nflush_s = 0\n[trackers.sheet]\n"
    with pytest.raises(config.ConfigError) as caught:
        loads(text)
    lines = text.splitlines()
    found = [line.split(": ") for line in str(caught.value).splitlines()[1:]]
    assert [(key.partition(" = ")[0], lines[int(place.split()[1]) - 1]) for place, key, *_ in found] == [
        ("sensors.tof.device", 'device = "sam"'),
        ("record.flush_s", "flush_s = 0"),
        ("trackers.sheet.sensors", "[trackers.sheet]"),
        ("trackers.sheet.model", "[trackers.sheet]"),
    ]


def test_addresses_are_checked_with_everything_else():
    text = SENSORS.replace("seed=1", "sede=1") + '[devices.k]\nuri = "kinekt1://"\n[record]\nflush_s = 0\n'
    found = mistakes(text)
    assert found[0].startswith("devices.sim.uri = \"simulated://sheet?sede=1\": unknown key 'sede'; allowed are")
    assert found[1].startswith('devices.k.uri = "kinekt1://": no such driver, did you mean "kinect1"? allowed: ')
    assert found[2].startswith("record.flush_s = 0")


def test_mistakes_are_told_with_those_of_the_calibration_file(tmp_path):
    (tmp_path / "x.toml").write_text('version = 1\nname = "bench"\n\n[sensors.tof]\nrange_m = -1.0\n')
    text = 'calibration = "x.toml"\n' + SENSORS + "[record]\nflush_s = 0\n[sensors.tof.camera]\nfx = 1.0\n"
    with pytest.raises(config.ConfigError) as caught:
        config.loads(text, "rig.toml", tmp_path)
    assert [line.strip().partition(" = ")[0] for line in str(caught.value).splitlines()] == [
        f"{tmp_path / 'x.toml'}: 2 errors",
        "provenance: missing, but needed",
        "line 5: sensors.tof.range_m",
        "rig.toml: line 20: record.flush_s",
    ]


def test_a_recording_that_begins_with_tracking_needs_a_tracker():
    (found,) = mistakes(SENSORS + '[record]\nbegin = "tracking"\n')
    assert found == 'record.begin = "tracking": the rig has no tracker to wait for; allowed is "start"'
    (found,) = mistakes(SENSORS + '[record]\nwhen = "not_tracking"\n')
    assert found == 'record.when = "not_tracking": the rig has no tracker; allowed are "always" and "requested"'


def test_the_view_into_which_images_are_warped_is_that_of_a_sensor_of_the_tracker():
    tracker = """[trackers.sheet]
sensors = ["tof"]
model = { type = "rigid" }
synthesis = { type = "warped", sensor = "color" }
"""
    (found,) = mistakes(SENSORS + tracker)
    assert found == 'trackers.sheet.synthesis.sensor = "color": no sensor of this tracker, allowed: tof'


def test_a_tracker_needs_sensors_with_noise_models_and_a_reference():
    tracker = '[trackers.tof]\nsensors = ["tof", "rgb", "color", "tof"]\nreference = "tov/depth"\n'
    found = "\n".join(mistakes(SENSORS.replace('reference = "tof/depth"', "") + tracker))
    assert 'trackers.tof.reference = "tov/depth": no such sensor, did you mean "tof"? allowed: color, tof' in found
    assert "trackers.tof: a sensor has this name" in found
    assert 'trackers.tof.sensors[1] = "rgb": no such sensor, allowed: color, tof' in found
    assert 'sensors.color.noise: missing, but tracker "tof" weighs its measurements with it, such as {' in found
    assert 'trackers.tof.sensors[3] = "tof": named twice' in found
    assert "trackers.tof.model: missing" in found


def test_a_tracker_without_any_reference_is_an_error_with_a_remedy():
    text = SENSORS.replace('reference = "tof/depth"', "") + '[trackers.sheet]\nsensors = ["tof"]\n'
    assert any(line.startswith("trackers.sheet.reference: missing") for line in mistakes(text))


def test_a_file_that_is_not_toml_is_reported_with_the_line():
    assert "line 2" in mistakes("version = 1\nname = \n")[0]


def test_a_duplicate_name_is_reported_with_the_line():
    assert "line" in mistakes(SENSORS + '[devices.sim]\nuri = "simulated:x"\n')[0]


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(config.ConfigError, match=r"none\.toml: cannot be read: No such file"):
        config.load(tmp_path / "none.toml")
    with pytest.raises(config.ConfigError, match=r"x\.mcap: this is a recording, not a configuration"):
        config.load(tmp_path / "x.mcap")
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe4"')
    with pytest.raises(config.ConfigError, match="byte 8"):
        config.load(tmp_path / "latin.toml")


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(b"a" * (2 << 20), "larger than 1048576 bytes"), (b"a = " + b"[" * 100_000, "nested too deeply|not TOML")],
)
def test_a_file_that_is_no_rig_file_is_refused_without_being_read_to_its_end(tmp_path, content, complaint):
    path = tmp_path / "rig.toml"
    path.write_bytes(content)
    with pytest.raises(config.ConfigError, match=complaint):
        config.load(path)


def test_a_device_without_end_is_no_rig_file():
    with pytest.raises(config.ConfigError, match=r"/dev/zero: .*no regular file"):
        config.load(Path("/dev/zero"))


@pytest.mark.parametrize("offered", re.findall(r"\{.*?\}", references.NOISE_EXAMPLES))
def test_a_noise_model_that_a_message_offers_is_one(offered):
    noise = loads(SENSORS.replace('head = "rgb"', f"noise = {offered}")).sensors["color"].noise
    assert noise is not None
    assert measurement(noise)
