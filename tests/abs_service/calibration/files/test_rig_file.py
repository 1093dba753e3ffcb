"""Calibration files: exact round trips, rigs that use them, and mistakes named with both files."""

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service import config, wiring
from abs_service.calibration.files import toml_text
from abs_service.calibration.files.rig_file import (
    Covariance,
    Residuals,
    RigCalibration,
    RigFileError,
    SensorCalibration,
    read_covariance,
    write,
)
from abs_service.commands.calibrate.inputs import calibrations
from abs_service.report.provenance import DataFile, Provenance
from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens

PROVENANCE = Provenance('abs-service calibrate rig "a b"', "2026-11-21T12:00:00Z", "0.1.0", (DataFile("x/", "ab"),))
TOF = Camera(176, 144, 220.1, 221.7, 87.3, 71.9, Lens(np.array([-0.2, 0.03, 0, 1e-4])))
FISHEYE = KannalaBrandt(np.array([0.01, -2e-3]))
COLOR = Camera(
    640, 480, 500.0, 501.0, 320.0, 240.0, FISHEYE, pose.from_rotation_vector((0.01, -0.2, 3.0), (0.05, 0, 1e-3))
)
COVARIANCE = Covariance(("tof.fx", "color.x", "board 0.x"), np.diag([0.25, 1e-8, 1e-6]), ("0f3a", "77c1"))
NOISE = {"type": "tof_amplitude", "sigma": [0.0015, 0.0005], "sigma_amplitude": 9.0}

CALIBRATION = RigCalibration(
    "bench",
    {
        "tof": SensorCalibration(
            TOF, 0.004, -0.002, 0.0015, NOISE, factory=COLOR, residuals=Residuals(0.12, 0.0021, 14, 12)
        ),
        "color": SensorCalibration(COLOR),
    },
    PROVENANCE,
    "doubtful",
    COVARIANCE,
)

RIG = """
version = 1
name = "bench"
calibration = "lab/bench.calibration.toml"

[devices.sim]
uri = "simulated://sheet?seed=1"

[sensors.tof]
device = "sim"

[sensors.color]
device = "sim"
noise = { type = "color", sigma = 4.0 }

[synchronisation]
reference = "tof/depth"

[trackers.sheet]
sensors = ["tof", "color"]
model = { type = "rigid" }
"""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "lab").mkdir()
    write(CALIBRATION, tmp_path / "lab" / "bench.calibration.toml")
    path = tmp_path / "rig.toml"
    path.write_text(RIG, encoding="utf-8")
    return path


def assert_same_camera(found: Camera, expected: Camera, tolerance: float = 1e-12) -> None:
    for key in ("width", "height", "fx", "fy", "cx", "cy"):
        assert getattr(found, key) == getattr(expected, key)
    assert found.lens.name == expected.lens.name
    assert found.lens.coefficients.tolist() == expected.lens.coefficients.tolist()
    np.testing.assert_allclose(found.T_rs, expected.T_rs, rtol=0, atol=tolerance)


numbers = st.floats(-3, 3, allow_subnormal=False)


@settings(max_examples=30)
@given(
    st.lists(numbers, max_size=8),
    st.tuples(numbers, numbers, numbers),
    st.tuples(numbers, numbers, numbers),
    st.tuples(*[st.floats(0.1, 1e5)] * 4),
)
def test_what_is_written_is_what_is_read(tmp_path_factory, lens, turn, place, matrix) -> None:
    path = tmp_path_factory.mktemp("written") / "x.calibration.toml"
    camera = Camera(640, 480, *matrix, lens=Lens(np.array(lens)), T_rs=pose.from_rotation_vector(turn, place))
    sensors = {"tof": dataclasses.replace(CALIBRATION.sensors["tof"], camera=camera)}
    write(dataclasses.replace(CALIBRATION, sensors=sensors), path)
    found = calibrations.load(path)
    assert_same_camera(found.sensors["tof"].camera, camera)
    assert found.sensors["tof"].factory is not None
    assert_same_camera(found.sensors["tof"].factory, COLOR)


def test_everything_else_comes_back_too(rig: Path) -> None:
    for path in (rig.parent / "lab" / "bench.calibration.toml", rig):
        found = calibrations.load(path)
        tof = found.sensors["tof"]
        assert (found.name, found.verdict, found.provenance) == ("bench", "doubtful", PROVENANCE)
        assert (tof.depth_offset, tof.depth_scale, tof.time_offset) == (0.004, -0.002, 0.0015)
        assert tof.residuals == Residuals(0.12, 0.0021, 14, 12)
        assert tof.noise.items() >= NOISE.items()
        assert found.covariance.names == COVARIANCE.names
        np.testing.assert_array_equal(found.covariance.matrix, COVARIANCE.matrix)
        assert found.covariance.views == COVARIANCE.views


def test_the_file_tells_people_the_deviation_of_every_parameter(rig: Path) -> None:
    file = config.load_calibration(rig.parent / "lab" / "bench.calibration.toml")
    assert file.sensors["tof"].sigma == {"fx": 0.5}
    assert file.sensors["color"].sigma == {"x": pytest.approx(1e-4)}


def test_a_rig_uses_the_calibration_that_it_names(rig: Path) -> None:
    made = config.load(rig)
    factory = {name: Camera(8, 6, 5.0, 5.0, 4.0, 3.0) for name in ("tof", "color")}
    cameras = {name: made.sensors[name].camera.applied_to(camera) for name, camera in factory.items()}
    assert_same_camera(cameras["tof"], TOF)
    assert_same_camera(cameras["color"], COLOR)
    tof = wiring.rig(made, "sheet", cameras).sensors["tof"]
    assert (tof.depth_offset, tof.depth_scale) == (0.004, -0.002)


def test_a_calibration_may_begin_with_the_mark_that_some_editors_write(rig: Path) -> None:
    path = rig.parent / "lab" / "bench.calibration.toml"
    before = config.load(rig).sensors
    path.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert config.load(rig).sensors == before


def test_the_merged_configuration_needs_no_other_file_and_knows_where_it_comes_from(rig: Path, tmp_path: Path) -> None:
    made = config.load(rig)
    text = config.to_toml(made)
    (rig.parent / "lab" / "bench.calibration.toml").unlink()
    assert config.loads(text, "published", tmp_path / "elsewhere") == made
    assert made.calibration is not None
    assert made.calibration.provenance.command == PROVENANCE.command
    assert made.calibration.provenance.data[0].name == "x/"
    assert "camera.fx" in made.calibration.sensors["tof"].keys


def refusal(rig: Path) -> str:
    with pytest.raises(config.ConfigError) as caught:
        config.load(rig)
    return str(caught.value)


def test_what_both_files_say_is_a_mistake_that_names_both_places(rig: Path) -> None:
    rig.write_text(RIG + "[sensors.tof.camera]\nT_rs = {}\n[sensors.tof.noise]\ntype = 'constant'\n", encoding="utf-8")
    message = refusal(rig)
    assert message.startswith(f"{rig}: 2 errors")
    assert f"sensors.tof.camera.T_rs = {{}}: {rig.parent / 'lab' / 'bench.calibration.toml'} has" in message
    assert "sensors.tof.noise" in message


def test_a_calibration_of_sensors_that_the_rig_lacks_is_refused(rig: Path) -> None:
    rig.write_text(RIG.replace("[sensors.color]", "[sensors.colour]"), encoding="utf-8")
    message = refusal(rig)
    assert re.search(r"bench.calibration.toml: line \d+: sensors.color: no such sensor in", message)
    assert 'did you mean "colour"? allowed: colour, tof' in message


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fx = 220.1", "fx = -1.0", "sensors.tof.camera.fx = -1.0"),
        ("fx = 220.1\n", "", "missing: fx"),
        ("[sensors.color.camera]", "[sensors.color.camra]", "camra: unknown key"),
        ("offset = 0.004", "ofset = 0.004", 'ofset: unknown key, did you mean "offset"?'),
        ("version = 1\n", "version = 2\n", "version = 2"),
        ("[provenance]", "[[provenance", "not TOML"),
    ],
)
def test_mistakes_in_the_calibration_name_its_file_and_the_key(rig: Path, old: str, new: str, said: str) -> None:
    path = rig.parent / "lab" / "bench.calibration.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    message = refusal(rig)
    assert message.startswith(f"{path}: ")
    assert said in message


def test_a_calibration_that_is_not_there_is_named(rig: Path) -> None:
    (rig.parent / "lab" / "bench.calibration.toml").unlink()
    assert refusal(rig).startswith(f"{rig.parent / 'lab' / 'bench.calibration.toml'}: the calibration cannot be read")


def test_covariances_of_another_calibration_are_refused(rig: Path) -> None:
    other = dataclasses.replace(CALIBRATION, covariance=Covariance(("tof.fx",), np.eye(1)))
    write(other, rig.parent / "other.calibration.toml")
    (rig.parent / "other.calibration.npz").replace(rig.parent / "lab" / "bench.calibration.npz")
    with pytest.raises(RigFileError, match="not the covariances of this calibration"):
        calibrations.load(rig)
    with pytest.raises(RigFileError, match="cannot be read"):
        read_covariance(rig.parent / "none.npz", "")


def test_a_camera_that_is_left_to_the_device_is_no_calibration(rig: Path) -> None:
    text = RIG.replace("calibration =", "#").replace(
        "[sensors.tof]", f"[sensors.tof]\nnoise = {toml_text.value(NOISE)}"
    )
    rig.write_text(text, encoding="utf-8")
    with pytest.raises(calibrations.StoredCalibrationError, match=r"sensors\.tof\.camera: width"):
        calibrations.load(rig)


def test_a_noise_model_in_a_file_is_found_from_the_calibration_s_folder(rig: Path) -> None:
    maps = {"type": "pixel_polynomial", "file": "maps.npz"}
    sensors = {"tof": dataclasses.replace(CALIBRATION.sensors["tof"], noise=maps)}
    write(dataclasses.replace(CALIBRATION, sensors=sensors), rig.parent / "lab" / "bench.calibration.toml")
    noise: Any = config.load(rig).sensors["tof"].noise
    assert noise.file == rig.parent / "lab" / "maps.npz"
    assert calibrations.load(rig.parent / "lab" / "bench.calibration.toml").sensors["tof"].noise["file"] == "maps.npz"


def test_a_calibration_that_cannot_be_written_says_where(tmp_path: Path) -> None:
    with pytest.raises(RigFileError, match="absent"):
        write(CALIBRATION, tmp_path / "absent" / "x.calibration.toml")
