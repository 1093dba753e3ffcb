"""`abs-service calibrate convert`: published calibrations of others, and what it says about what it cannot do."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import rig_file
from abs_service.commands.calibrate import calibrations
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens

TOF = Camera(176, 144, 220.1, 221.7, 87.3, 71.9, Lens(np.array([-0.2, 0.03])))
NOISE = {"type": "tof_amplitude", "sigma": [0.0015], "sigma_amplitude": 9.0}
COLOR = Camera(640, 480, 500.0, 501.0, 320.0, 240.0, T_rs=pose.from_rotation_vector((0.01, -0.2, 0.3), (0.05, 0, 1e-3)))


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    path = tmp_path / "lab.calibration.toml"
    sensors = {
        "tof": rig_file.SensorCalibration(TOF, depth_offset=0.01, noise=NOISE),
        "color": rig_file.SensorCalibration(COLOR),
    }
    rig_file.write(rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-21")), path)
    return path


@pytest.fixture
def convert(capsys):
    """Runs the command; gives the exit code and what was printed."""

    def convert(*arguments: object) -> tuple[int, str, str]:
        code = cli.main(["calibrate", "convert", *map(str, arguments)])
        return code, *capsys.readouterr()

    return convert


@pytest.mark.parametrize(
    ("name", "options"),
    [("c.yaml", ("--to", "kalibr")), ("c.xml", ()), ("c.json", ("--to", "depthai")), ("c.yml", ("--to", "opencv"))],
)
def test_there_and_back_again(convert, lab: Path, name: str, options: tuple[str, ...]) -> None:
    between, back = lab.parent / name, lab.parent / "back.toml"
    code, out, err = convert(lab, between, *options)
    assert (code, out) == (Exit.OK, f"wrote {between}: tof, color\n")
    assert "lost: tof: depth terms" in err
    assert "lost: tof: noise model" in err
    renamed = ("--rename", "cam_a=tof", "--rename", "cam_b=color") if name == "c.json" else ()
    assert convert(between, back, *renamed)[0] == Exit.OK
    found = calibrations.load(back)
    assert found.verdict == "unknown"
    assert [one.name for one in found.provenance.data] == [name]
    for sensor, camera in (("tof", TOF), ("color", COLOR)):
        assert found.sensors[sensor].camera.fx == pytest.approx(camera.fx, rel=1e-12)
        np.testing.assert_allclose(found.sensors[sensor].camera.T_rs, camera.T_rs, atol=1e-9)
        np.testing.assert_allclose(found.sensors[sensor].camera.lens.coefficients, camera.lens.coefficients)


def test_files_of_one_camera_are_put_together(convert, lab: Path) -> None:
    parts = [lab.parent / "tof.cameramodel", lab.parent / "color.cameramodel"]
    for part in parts:
        assert convert(lab, part, "--sensor", part.stem)[0] == Exit.OK
    assert convert(*parts, lab.parent / "both.toml")[0] == Exit.OK
    found = calibrations.load(lab.parent / "both.toml")
    np.testing.assert_allclose(found.sensors["color"].camera.T_rs, COLOR.T_rs, atol=1e-9)
    assert found.sensors["tof"].camera.lens.coefficients[0] == -0.2


def test_the_same_for_scripts(convert, lab: Path) -> None:
    code, out, err = convert(lab, lab.parent / "x.yaml", "--to", "ros", "--sensor", "color", "--json")
    found = json.loads(out)
    assert (code, err, found["sensors"]) == (Exit.OK, "", ["color"])
    assert "the pose of color" in found["lost"]


def test_a_size_that_is_not_the_camera_s_resizes_it(convert, lab: Path) -> None:
    assert convert(lab, lab.parent / "small.toml", "--sensor", "color", "--size", "320x240")[0] == Exit.OK
    small = calibrations.load(lab.parent / "small.toml").sensors["color"].camera
    assert (small.width, small.fx, small.cx) == (320, 250.0, 159.75)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("lab.calibration.toml", "lab.calibration.toml"), "exists already"),
        (("none.yaml", "x.toml"), "cannot be read"),
        (("lab.calibration.toml", "x.yaml"), "say one with --to"),
        (("text.yaml", "x.toml"), "say it with --from"),
        (("lab.calibration.toml", "x.toml", "--sensor", "colour"), 'did you mean "color"?'),
        (("lab.calibration.toml", "x.toml", "--rename", "tof"), "must be OLD=NEW"),
        (("lab.calibration.toml", "x.toml", "--rename", "toff=a"), 'did you mean "tof"?'),
        (("lab.calibration.toml", "x.toml", "--rename", "tof=color"), "two cameras are called"),
        (("lab.calibration.toml", "x.toml", "--size", "640"), "such as 640x480"),
        (("lab.calibration.toml", "x.yaml", "--to", "ros"), "choose one of tof, color"),
        (("text.yaml", "x.toml", "--from", "kalibr"), "text.yaml: no camera chain"),
        (("lab.calibration.toml", "absent/x.toml"), "absent"),
    ],
)
def test_what_cannot_be_done_is_said(convert, lab: Path, monkeypatch, arguments: tuple[str, ...], said: str) -> None:
    monkeypatch.chdir(lab.parent)
    (lab.parent / "text.yaml").write_text("a: 1\n")
    code, out, err = convert(*arguments)
    assert (code, out) == (Exit.USER, "")
    assert said in err


def test_published_calibrations_are_read(convert, data_set: Callable[[str], Path], tmp_path: Path) -> None:
    registration = data_set("calib_azure_charuco") / "example_files" / "registration"
    names = ("--rename", "calib_color=color", "--rename", "calib_ir=ir")
    pair = registration / "calib_color.yml", registration / "calib_ir.yml"
    assert convert(*pair, tmp_path / "k4a.toml", *names)[0] == Exit.OK
    k4a = calibrations.load(tmp_path / "k4a.toml").sensors
    assert (k4a["color"].camera.width, k4a["ir"].camera.width) == (4096, 1024)
    assert k4a["color"].camera.fx == pytest.approx(1960.8795300703463, rel=1e-14)
    assert np.all(k4a["ir"].camera.lens.coefficients != 0)
    stereo = data_set("calib_opencv_stereo")
    code, _, err = convert(
        stereo / "intrinsics.yml", stereo / "left_intrinsics.yml", tmp_path / "s.toml", "--size", "640x480"
    )
    assert code == Exit.OK
    assert "R and T are missing" in err
    found = calibrations.load(tmp_path / "s.toml").sensors
    assert found["left"].camera.fx == pytest.approx(534.80326845051309, rel=1e-14)
    assert found["left_intrinsics"].camera.lens.coefficients[4] == pytest.approx(0.23839153080878486, rel=1e-14)
