"""`abs-service calibrate convert`: published calibrations of others, and what it says about what it cannot do."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import rig_file
from abs_service.commands.calibrate.inputs import calibrations
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit
from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
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
        try:
            code = cli.main(["calibrate", "convert", *map(str, arguments)])
        except SystemExit as end:  # by argparse
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return convert


@pytest.mark.parametrize(
    ("name", "options"),
    [("c.yaml", ("--to", "kalibr")), ("c.xml", ()), ("c.json", ("--to", "depthai")), ("c.yml", ("--to", "opencv"))],
)
def test_there_and_back_again(convert, lab: Path, name: str, options: tuple[str, ...]) -> None:
    between, back = lab.parent / name, lab.parent / "back.toml"
    code, out, err = convert(lab, between, *options)
    apart = "tof, color: 50.0 mm apart, turned by 20.67°, color to the right of tof"
    assert (code, out) == (Exit.OK, f"wrote {between}: tof, color\n  {apart}\n")
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


def test_the_two_files_of_a_pair_of_opencv_are_put_together(convert, tmp_path: Path) -> None:
    turn = cv2.Rodrigues(np.array([0, 0.1, 0]))[0]
    cameras = {}
    for side in "12":
        cameras |= {f"M{side}": np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), f"D{side}": np.zeros((1, 5))}
    for name, values in (
        ("intrinsics.yml", cameras),
        ("extrinsics.yml", {"R": turn, "T": np.array([[-60.0], [1], [2]]), "Q": np.eye(4)}),
    ):
        storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
        for key, value in values.items():
            storage.write(key, value)
        storage.release()
    inputs, options = (tmp_path / "intrinsics.yml", tmp_path / "extrinsics.yml"), ("--size", "640x480", "--unit", "mm")
    code, said, _ = convert(*inputs, tmp_path / "pair.toml", *options)
    assert code == Exit.OK
    assert "left, right: 60.0 mm apart" in said
    code, _, said = convert(inputs[1], tmp_path / "alone.toml", *options)
    assert code == Exit.USER
    assert "give the file with M1 and M2 as well" in said


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
        (("text.yaml", "x.toml"), "`calibrate convert --from` takes toml"),
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


def stored(path: Path, **values: Any) -> Path:
    """A file of OpenCV."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, np.array(value, float) if isinstance(value, list) else value)
    storage.release()
    return path


K = [[500.0, 0, 320], [0, 501, 240], [0, 0, 1]]
PAIR = {"M1": K, "M2": K, "R": np.eye(3).tolist(), "T": [[-83.2], [0.5], [1]]}


def test_translations_in_millimetres_are_not_taken_for_metres(convert, tmp_path: Path) -> None:
    given = stored(tmp_path / "p.yml", **PAIR)
    code, _, err = convert(given, tmp_path / "a.toml", "--size", "640x480")
    assert (code, (tmp_path / "a.toml").exists()) == (Exit.USER, False)
    assert "left, right are 83.21 m apart" in err
    assert "--unit" in err
    code, out, _ = convert(given, tmp_path / "a.toml", "--size", "640x480", "--unit", "mm")
    assert code == Exit.OK
    assert "left, right: 83.2 mm apart, turned by 0.00°" in out
    right = calibrations.load(tmp_path / "a.toml").sensors["right"].camera
    np.testing.assert_allclose(right.T_sr[:3, 3], (-0.0832, 0.0005, 0.001), atol=1e-12)


def test_four_coefficients_are_those_of_the_lens_that_is_said(convert, tmp_path: Path) -> None:
    given = stored(tmp_path / "f.yml", K=K, D=[[0.1], [-0.02], [0.003], [0.001]], image_width=640, image_height=480)
    code, _, err = convert(given, tmp_path / "f.toml")
    assert (code, (tmp_path / "f.toml").exists()) == (Exit.USER, False)
    assert "--lens fisheye" in err
    for kind, lens in (("fisheye", KannalaBrandt), ("brown-conrady", Lens)):
        assert convert(given, tmp_path / f"{kind}.toml", "--lens", kind)[0] == Exit.OK
        found = calibrations.load(tmp_path / f"{kind}.toml").sensors["f"].camera.lens
        assert isinstance(found, lens)
        assert found.coefficients[:4].tolist() == [0.1, -0.02, 0.003, 0.001]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"K": [[500.0, 3, 320], [0, 501, 240], [0, 0, 1]]}, "a skew of 3 moves the top of the image by 1.4 px"),
        ({"K": [[4.6, 0, 320], [0, 4.6, 240], [0, 0, 1]]}, "its field of view is 178° × 178°"),
        ({"K": [[500.0, 0, 960], [0, 500, 540], [0, 0, 1]]}, "its principal point (960, 540) is outside"),
        ({"xi": [[1.2]]}, "omnidirectional"),
        ({"D": [[0.1, 0, 0, 0]], "distortion_model": "fisheye", "option": "brown-conrady"}, "the file says fisheye"),
    ],
)
def test_what_would_be_read_wrongly_is_refused(convert, tmp_path: Path, changes: dict, said: str) -> None:
    values = {"K": K, "image_width": 640, "image_height": 480} | changes
    options = ("--lens", values.pop("option")) if "option" in values else ()
    code, _, err = convert(stored(tmp_path / "f.yml", **values), tmp_path / "f.toml", *options)
    assert (code, (tmp_path / "f.toml").exists()) == (Exit.USER, False)
    assert said in err


def test_what_is_left_out_of_a_file_of_opencv_is_listed(convert, tmp_path: Path) -> None:
    given = stored(tmp_path / "f.yml", K=K, image_width=640, image_height=480, exposure=5)
    assert "lost: f: exposure" in convert(given, tmp_path / "f.toml")[2]
    assert "says itself" in convert(tmp_path / "f.toml", tmp_path / "g.xml", "--lens", "fisheye")[2]


def test_a_published_skew_is_refused(convert, data_set: Callable[[str], Path], tmp_path: Path) -> None:
    text = (data_set("calib_opencv_stereo") / "left_intrinsics.yml").read_text(encoding="utf-8")
    skewed = text.replace("0., 3.42", "2.5, 3.42", 1)
    assert skewed != text
    (tmp_path / "s.yml").write_text(skewed, encoding="utf-8")
    code, _, err = convert(tmp_path / "s.yml", tmp_path / "s.toml", "--size", "640x480")
    assert code == Exit.USER
    assert "skew of 2.5" in err
