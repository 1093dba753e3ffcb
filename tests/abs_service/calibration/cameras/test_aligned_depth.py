"""Five views of a board in the aligned depth image of a RealSense, which reads 0.6 to 1.5 % longer than corners say.

Images of github.com/t-walker-21/extrinsicCalibration as `color_N.png` and `depth_N.png` (mm).
"""

from collections.abc import Callable
from pathlib import Path

import pytest

from abs_service import cli
from abs_service.calibration.files import rig_file, target_file
from abs_service.commands.calibrate.inputs import calibrations
from abs_service.report.provenance import Provenance
from calib.board.target import Chessboard
from calib.camera import Camera

CAMERA = Camera(848, 480, 617.0289198, 617.010437011, 422.6674499, 248.56015)


@pytest.fixture
def given(data_set: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Stored calibration, recording and options of the board."""
    folder = data_set("realsense_checkerboard")
    keys = "\n".join(f"{key} = {getattr(CAMERA, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy"))
    camera, board, take, stored = (tmp_path / name for name in ("camera.toml", "board.toml", "take.mcap", "lab.toml"))
    camera.write_text(f"[depth]\n{keys}\n[color]\n{keys}\n", encoding="utf-8")
    target_file.write(Chessboard(9, 6, 0.02315), board)
    options = ["--layout", "pairs", "--camera", str(camera), "--rate", "1", "--out", str(take)]
    assert cli.main(["import", str(folder), *options]) == 0
    sensors = {name: rig_file.SensorCalibration(CAMERA) for name in ("depth", "color")}
    rig_file.write(rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-21")), stored)
    capsys.readouterr()
    return [str(stored), str(take), "--target", str(board)]


def test_it_is_said_to_measure_too_long_and_not_to_have_moved(
    given: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["calibrate", "verify", *given]) == 2
    said = capsys.readouterr().out
    assert "depth: measures distances wrongly, by +0.9" in said
    assert "These shots cannot tell that from this: depth measures distances wrongly, by +4." in said
    assert "no longer stand" not in said


def test_its_scale_is_found_where_its_pose_is_kept_and_not_believed_where_it_is_free(
    given: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored, *rest = given
    options = ["--keep", "color", "--reference", "color", "--depth-terms", "depth=scale"]
    common = ["calibrate", "rig", *rest, "--start", stored, *options]
    kept, free = tmp_path / "kept.toml", tmp_path / "free.toml"
    assert cli.main([*common, "--fixed-pose", "depth", "--out", str(kept)]) == 1  # five shots
    found = calibrations.load(kept).sensors["depth"]
    assert 0.006 < found.depth_scale < 0.015
    assert found.camera.T_rs[:3, 3] == pytest.approx(0, abs=1e-12)
    capsys.readouterr()
    assert cli.main([*common, "--out", str(free)]) == 1
    assert "depth: the scale of its distances, its position along the view" in capsys.readouterr().out
    assert calibrations.load(free).verdict == "doubtful"
