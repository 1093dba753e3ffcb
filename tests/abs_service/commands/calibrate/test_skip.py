"""`--skip`: which shots are left out, and that these are there."""

import argparse
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import target_file
from abs_service.calibration.shots.shots import Shot
from abs_service.commands.calibrate.inputs import skipping
from abs_service.commands.parts.options import OptionError
from calib.board.target import Chessboard


def test_numbers_and_ranges_of_shots() -> None:
    assert skipping.numbers("3,7-9") == {3, 7, 8, 9}
    assert skipping.text(skipping.numbers("9,3")) == "3,9"
    for wrong in ("", "a", "9-3", "3,,4", "-3"):
        with pytest.raises(argparse.ArgumentTypeError, match="such as 3,7-9"):
            skipping.numbers(wrong)


def test_shots_are_left_out_and_have_to_be_there() -> None:
    shots = [Shot(number, {}) for number in (1, 2, 5)]
    assert [shot.number for shot in skipping.kept(shots, {2}, None)] == [1, 5]
    with pytest.raises(OptionError, match="no shot 3; they are numbered from 1 to 5"):
        list(skipping.kept(shots, {2, 3}, None))
    with pytest.raises(OptionError, match="running devices"):
        list(skipping.kept(shots, {2}, Path("rig.toml")))


def test_a_shot_that_does_not_exist_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target_file.write(Chessboard(9, 6, 0.025), tmp_path / "board.toml")
    cv2.imwrite(str(tmp_path / "c_1.png"), np.full((120, 160), 90, np.uint8))
    given = ["--images", f"c={tmp_path}/c_*.png", "--target", str(tmp_path / "board.toml"), "--skip", "4"]
    assert cli.main(["calibrate", "intrinsics", *given, "--out", str(tmp_path / "out.toml")]) == 2
    assert "--skip 4: there is no shot 4; they are numbered from 1 to 1" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_exchanged_images_of_a_real_pair_are_named_and_left_out(
    tmp_path: Path, data_set: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    target_file.write(Chessboard(9, 6, 0.025), tmp_path / "board.toml")
    for path in data_set("calib_opencv_stereo").glob("*.jpg"):
        exchanged = {"right03.jpg": "right07.jpg", "right07.jpg": "right03.jpg"}.get(path.name, path.name)
        shutil.copy(path, tmp_path / exchanged)
    images = [word for side in ("left", "right") for word in ("--images", f"{side}={tmp_path}/{side}*.jpg")]
    given = ["calibrate", "rig", *images, "--target", str(tmp_path / "board.toml")]
    assert cli.main([*given, "--out", str(tmp_path / "a.toml")]) == 1
    said = capsys.readouterr().out
    assert "2 shots contradict the others: shot " in said
    assert "--skip 3,7" in said
    cli.main([*given, "--skip", "3,7", "--out", str(tmp_path / "b.toml")])
    assert "contradict" not in capsys.readouterr().out
