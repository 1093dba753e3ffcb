"""`calibrate rig` and `calibrate intrinsics` from rendered images to calibration file, report and exit code."""

import json
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import target_file
from abs_service.commands.calibrate import calibrations
from calib import pose
from tests.abs_service.calibration.simulated import Filmed, record, scene

BOARD = scene(
    "chessboard",
    "sensors=tof,structured_light,color",
    "rate=4",
    "seed=5",
    "color=640x480",
    "hold=0.5",
    "lens=-0.15,0.05",
)
EXPOSURES = 36


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the board and its description."""
    made = tmp_path_factory.mktemp("rig")
    record(Filmed(BOARD.simulation, EXPOSURES), made / "take.mcap")
    target_file.write(BOARD.target, made / "board.toml")
    return made


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_rig_is_calibrated_from_rendered_images(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "lab.calibration.toml"
    code = cli.main(
        f"calibrate rig {folder}/take.mcap --target {folder}/board.toml --out {out} --keep tof "
        "--depth-terms tof=offset --needed 5 --every 0.4 --json".split()
    )
    said = json.loads(capsys.readouterr().out)
    assert code == (0 if said["trusted"] else 1)
    assert all(Path(name).is_file() for name in said["files"])
    known = calibrations.load(out)
    truth = {name: head.camera for name, head in BOARD.simulation.heads.items()}
    for name, limit_mm in (("color", 4.0), ("structured_light", 10.0)):
        T_rs = known.sensors[name].camera.T_rs
        error = T_rs @ pose.inverse(truth[name].T_rs)
        assert np.linalg.norm(T_rs[:3, 3] - truth[name].T_rs[:3, 3]) * 1e3 < limit_mm, name
        assert np.degrees(np.linalg.norm(pose.to_rotation_vector(error)[0])) < 0.6, name
    color = known.sensors["color"].camera
    assert color.fx == pytest.approx(truth["color"].fx, rel=0.01)
    assert known.covariance.of("color")["fx"] > 0
    report = json.loads((folder / "lab.calibration.json").read_text(encoding="utf-8"))
    assert report["verdicts"][0]["text"].startswith(("Trust it: ", "Do not trust it yet: "))
    assert (folder / "lab.calibration.html").read_text(encoding="utf-8").count("<img") >= 8


def test_options_that_do_not_fit_are_answered_with_what_would(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "board.toml"
    target_file.write(BOARD.target, board)
    common = ["--target", str(board), "--out", str(tmp_path / "x.calibration.toml")]
    for arguments, message in (
        (["calibrate", "rig", *common], "give either a recording or rig as SOURCE, or --images"),
        (["calibrate", "rig", "--images", "color", *common], "--images color: must be NAME=VALUE"),
        (["calibrate", "intrinsics", str(tmp_path / "no.mcap"), *common], "no.mcap"),
        (["calibrate", "intrinsics", "--images", f"color={tmp_path}/*.png", *common], "color"),
    ):
        assert cli.main(arguments) == 2
        assert message in capsys.readouterr().err
