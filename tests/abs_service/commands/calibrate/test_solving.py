"""`calibrate rig` and `calibrate intrinsics` from rendered images to calibration file, report and exit code."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import corner_file, target_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.commands.calibrate.inputs import calibrations
from calib import pose
from calib.board.target import Chessboard
from evaluation.calibration.simulated_board import Filmed, record, scene
from evaluation.scenes.boards.board_views import COLUMNS, ROWS, SQUARE, look, random_boards, three_heads

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
        (["calibrate", "rig", "--images", "color", *common], "--images color: must be NAME=GLOB"),
        (["calibrate", "intrinsics", str(tmp_path / "no.mcap"), *common], "no.mcap"),
        (["calibrate", "intrinsics", "--images", f"color={tmp_path}/*.png", *common], "color"),
    ):
        assert cli.main(arguments) == 2
        assert message in capsys.readouterr().err


def test_a_kind_of_lens_that_does_not_exist_is_told_before_boards_are_looked_for(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["calibrate", "rig", "no.mcap", "--target", "no.toml", "--out", "x.toml", "--lens", "color=fish"])
    assert ended.value.code == 2
    assert '--lens: color=fish: did you mean "fisheye"?' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--lens", "colour=fisheye"], '--lens colour=fisheye: no sensor that saw the board, did you mean "color"?'),
        (["--sensor", "left"], "--sensor left: no sensor that saw the board, allowed: color"),
        (["--half", "2-9"], "--half 2,3,4,5,6,7,8,9: no shot 6 shows the board"),
    ],
)
def test_options_that_would_be_ignored_are_refused(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    generator = np.random.default_rng(0)
    head = replace(three_heads()["color"], camera=replace(three_heads()["color"].camera, T_rs=np.eye(4)))
    seen = look({"color": head}, random_boards(6, generator), generator).corners
    target_file.write(Chessboard(COLUMNS, ROWS, SQUARE), tmp_path / "board.toml")
    corner_file.write(BoardObservations(tuple(seen), sizes={"color": (1280, 720)}), tmp_path / "a.corners.npz")
    common = ["--target", str(tmp_path / "board.toml"), "--out", str(tmp_path / "x.toml")]
    assert cli.main(["calibrate", "intrinsics", str(tmp_path / "a.corners.npz"), *common, *options]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x.toml").exists()


def test_a_folder_in_place_of_images_is_answered_with_a_pattern(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target_file.write(Chessboard(COLUMNS, ROWS, SQUARE), tmp_path / "board.toml")
    arguments = [
        "--images",
        f"color={tmp_path}",
        "--target",
        str(tmp_path / "board.toml"),
        "--out",
        str(tmp_path / "x"),
    ]
    assert cli.main(["calibrate", "intrinsics", *arguments]) == 2
    assert f"{tmp_path} is a folder: name the images in it" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("--needed", "nan"), ("--needed", "0"), ("--distance", "-1")])
def test_an_accuracy_or_distance_that_is_none_is_refused(
    option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(["calibrate", "intrinsics", "a.mcap", "--target", "board.toml", "--out", "x.toml", option, value])
    assert f"argument {option}: '{value}' must be a number above 0" in capsys.readouterr().err
