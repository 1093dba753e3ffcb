"""`abs-service calibrate verify` on recordings of a simulated board: no alarm without reason, and who moved."""

import dataclasses
import json
import signal
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import rig_file, target_file
from abs_service.calibration.shots.corner_extraction import BoardObservations, see
from abs_service.commands.calibrate import verify as command
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit
from calib.camera import Camera
from drivers.replay import Recording
from evaluation.calibration.simulated_board import Filmed, record, scene

SCENE = scene("chessboard", "sensors=tof,structured_light,color", "rate=2", "seed=4", "color=640x480")
SENSORS = ("tof", "structured_light", "color")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight poses of the board, two exposures of each."""
    return record(Filmed(SCENE.simulation, 32), tmp_path_factory.mktemp("verify") / "board.mcap")


@pytest.fixture
def verify(recording: Path, tmp_path: Path, capsys):
    """Verifies a calibration in which one sensor stands elsewhere than in truth."""

    def verify(displaced: str = "", by: tuple[float, ...] = (0, 0, 0), *options: str) -> tuple[int, str, dict]:
        cameras = dict(Recording(recording).cameras)
        if displaced:
            T_rs = cameras[displaced].T_rs.copy()
            T_rs[:3, 3] += by
            cameras[displaced] = dataclasses.replace(cameras[displaced], T_rs=T_rs)
        path = tmp_path / "lab.calibration.toml"
        rig_file.write(calibration(cameras), path)
        target_file.write(SCENE.target, tmp_path / "board.toml")
        given = [str(path), str(recording), "--target", str(tmp_path / "board.toml"), "--every", "1.9", *options]
        code = cli.main(["calibrate", "verify", *given])
        report = json.loads((tmp_path / "lab.calibration-verify.json").read_text(encoding="utf-8"))
        return code, capsys.readouterr().out, report

    return verify


def calibration(cameras: dict[str, Camera]) -> rig_file.RigCalibration:
    """Calibration as a solve would have stored it: to a tenth of a millimetre and a hundredth of a degree."""
    names = [
        f"{name}.{part}" for name in SENSORS[1:] for part in ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
    ]
    sigmas = np.tile([2e-4, 2e-4, 2e-4, 1e-4, 1e-4, 1e-4], 2)
    residuals = rig_file.Residuals(corners_px=0.1)
    sensors = {name: rig_file.SensorCalibration(cameras[name], residuals=residuals) for name in SENSORS}
    covariance = rig_file.Covariance(tuple(names), np.diag(sigmas**2))
    return rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-21"), "good", covariance)


@pytest.mark.slow
def test_a_rig_that_is_as_it_was_is_good(verify, tmp_path: Path) -> None:
    code, out, report = verify()
    assert code == Exit.OK, out
    assert report["verdict"] == "good"
    assert "tof and color: stand as they were calibrated" in out
    assert "color: still projects as it was calibrated" in out
    assert {one["first"] + one["second"] for one in report["values"]["pairs"]} == {
        "tofstructured_light", "tofcolor", "structured_lightcolor"
    }  # fmt: skip
    page = (tmp_path / "lab.calibration-verify.html").read_text(encoding="utf-8")
    assert page.count("<img") == 2
    assert "board.mcap" in page


@pytest.mark.slow
def test_the_sensor_that_moved_is_named(verify) -> None:
    code, out, report = verify("color", (0.01, 0.0, 0.0), "--json")
    assert code == 2
    assert json.loads(out) == report
    worst = report["verdicts"][0]
    assert (worst["level"], worst["about"]) == ("bad", "color")
    assert worst["text"].startswith("has moved, by 1")
    possible = [one for one in report["values"]["explanations"] if one["possible"]]
    assert {"kind": "moved", "sensors": ["color"]}.items() <= possible[0].items()
    moved = next(one for one in report["values"]["pairs"] if (one["first"], one["second"]) == ("tof", "color"))
    np.testing.assert_allclose(moved["move_m"], (-0.01, 0, 0), atol=2e-3)


RIG = """
version = 1
name = "bench"
[devices.sim]
uri = "simulated://target?board=chessboard&sensors=tof,color&rate=10&hold=0.5&seed=4&color=640x480&speed=2"
[sensors.tof]
device = "sim"
[sensors.color]
device = "sim"
"""


@pytest.fixture
def live(tmp_path: Path) -> list[str]:
    """Arguments that verify a rig by its running devices; the colour camera of which stands 15 mm off in truth."""
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    target_file.write(SCENE.target, tmp_path / "board.toml")
    heads = SCENE.simulation.heads
    T_rs = heads["color"].camera.T_rs.copy()
    T_rs[0, 3] += 0.015
    cameras = {name: head.camera for name, head in heads.items()}
    cameras["color"] = dataclasses.replace(cameras["color"], T_rs=T_rs)
    rig_file.write(calibration(cameras), tmp_path / "lab.calibration.toml")
    names = ("lab.calibration.toml", "rig.toml", "board.toml")
    stored, rig, board = (str(tmp_path / name) for name in names)
    return ["calibrate", "verify", stored, rig, "--target", board]


@pytest.mark.slow
def test_running_devices_are_verified_by_views_that_differ(live: list[str], tmp_path: Path, capsys) -> None:
    code = cli.main([*live, "--shots", "6"])
    said = capsys.readouterr()
    assert code == Exit.USER, said.out
    assert "6 of 6 views" in said.err
    report = json.loads((tmp_path / "lab.calibration-verify.json").read_text(encoding="utf-8"))
    (pair,) = report["values"]["pairs"]
    np.testing.assert_allclose(pair["move_m"], (-0.015, 0, 0), atol=4e-3)
    assert "structured_light: did not see the board" in said.out
    assert "rig.toml" in {file["name"] for file in report["provenance"]["data"]}


@pytest.mark.slow
def test_ctrl_c_ends_the_looking_and_what_was_seen_counts(live: list[str], capsys, monkeypatch) -> None:
    seen, once = BoardObservations(), [signal.SIGINT]  # a second one ends the process on the spot

    def see_and_stop(*arguments) -> BoardObservations:
        nonlocal seen
        seen += (new := see(*arguments))
        if len({view.shot for view in seen.corners}) == 3 and once:
            signal.raise_signal(once.pop())
        return new

    monkeypatch.setattr(command, "see", see_and_stop)
    code = cli.main([*live, "--shots", "1000"])
    assert code in (Exit.FAILED, Exit.USER)
    said = capsys.readouterr()
    assert "of 1000 views" in said.err
    assert "wrote" in said.out


def test_a_rig_without_any_sensor_of_the_calibration_is_refused(live: list[str], tmp_path: Path, capsys) -> None:
    other = RIG.replace("sensors.tof", "sensors.left").replace("sensors.color", "sensors.right")
    heads = [f'[sensors.{name}]\ndevice = "sim"\n' for name in ("left", "right")]
    for old, head in zip(heads, ("tof", "color")):
        other = other.replace(old, f'{old}head = "{head}"\n')
    (tmp_path / "rig.toml").write_text(other, encoding="utf-8")
    assert cli.main(live) == Exit.USER
    assert "left, right: none of its sensors is one of" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("source", "said"),
    [
        (["none.mcap"], "none.mcap"),
        ([], "either a recording"),
        (["none.toml"], "none.toml"),
        (["a.mcap", "--images", "tof=*.png"], "either a recording"),
        (["--images", "tof"], "must be NAME=GLOB"),
        (["--images", "tof=none-*.png"], "no file matches"),
        (
            ["--images", "Tof=*.png"],
            'x.toml has no such sensor, did you mean "tof"? allowed: color, structured_light, tof',
        ),
    ],
)
def test_what_cannot_be_verified_is_said(tmp_path: Path, capsys, monkeypatch, source: list[str], said: str) -> None:
    monkeypatch.chdir(tmp_path)
    target_file.write(SCENE.target, Path("board.toml"))
    rig_file.write(calibration({name: Camera(64, 48, 50.0, 50.0, 32.0, 24.0) for name in SENSORS}), Path("x.toml"))
    assert cli.main(["calibrate", "verify", "x.toml", *source, "--target", "board.toml"]) == Exit.USER
    assert said in capsys.readouterr().err
