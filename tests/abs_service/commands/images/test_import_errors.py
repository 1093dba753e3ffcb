"""`abs-service import` says with exit code 2 what is wrong with a folder, a camera file or an option."""

from pathlib import Path

import pytest

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.images.importing import CAMERA, COLOR, open3d, run


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"intrinsic_matrix": [1, 2]}, "camera_intrinsic.json:\n  intrinsic_matrix"),
        ({"depth_scale": 0}, "camera_intrinsic.json:\n  depth_scale"),
        ({"width": None}, "camera_intrinsic.json:\n  width"),
    ],
)
def test_wrong_intrinsics_of_open3d_are_named(tmp_path: Path, capsys, changes, complaint) -> None:
    assert cli.main(open3d(tmp_path, "camera_intrinsic.json", **changes)) == Exit.USER
    assert complaint in capsys.readouterr().err


def test_a_folder_of_open3d_without_intrinsics_is_refused(tmp_path: Path, capsys) -> None:
    arguments = open3d(tmp_path, "other.json")
    assert cli.main(arguments) == Exit.USER
    assert "has neither camera_intrinsic.json nor intrinsic.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("camera", "options", "complaint"),
    [
        (CAMERA, ["--depth", "*.tiff"], "no file matches '*.tiff'"),
        (CAMERA, ["--color", "color_*.png"], "--color: "),
        (CAMERA, ["--mask", "m_*.png"], "no file matches 'm_*.png'"),
        (CAMERA, ["--mask", "mask_*[01].png"], "depth_002.png: no mask that matches 'mask_*[01].png' has the number 2"),
        (
            CAMERA,
            ["--depth", "color_*.png"],
            "color_000.png: depth must have one channel of 16 bits or of floating-point numbers, this is 3 × 8 bit;",
        ),
        (CAMERA.replace("width = 4", "width = 5"), [], "depth_000.png: the image has 4 × 3 pixels, its camera 5 × 3"),
        (CAMERA.replace("fx = 4.0\n", ""), [], "depth.fx: missing, but needed"),
        (CAMERA.replace("fx", "focal"), [], "depth.focal: unknown key"),
        (CAMERA.replace("fx = 4.0", "fx = -4.0"), [], "depth.fx = -4.0: must be greater than 0"),
        (CAMERA + "geometry = 'x'", [], "depth.geometry = \"x\": must be 'z' or 'radial'"),
        (CAMERA + "T_rs = { turn = 1 }", [], "depth.T_rs.turn: unknown key"),
        (COLOR, [], "depth: missing, but needed"),
        (CAMERA + "?", [], "camera.toml: cannot be understood"),
        (None, ["--camera", "nowhere.toml"], "nowhere.toml: cannot be read: No such file"),
        (None, [], "--camera: layout pairs needs a camera file"),
        (CAMERA, ["--rig", "nowhere.toml"], "nowhere.toml: cannot be read"),
        (CAMERA, ["--layout", "tum"], "depth.txt: cannot be read"),
        (CAMERA, ["--layout", "tum", "--mask", "m*"], "--mask: layout tum takes --camera, --depth-scale, --frames"),
        (CAMERA, ["--layout", "tum", "--depth", "d*"], "--depth: layout tum takes --camera, --depth-scale, --frames"),
        (CAMERA, ["--layout", "tum", "--rate", "9"], "--rate: layout tum takes --camera, --depth-scale, --frames"),
        (CAMERA, ["--out", "/nowhere/at/all.mcap"], "--out /nowhere/at/all.mcap: there is no folder /nowhere/at"),
    ],
)
def test_a_user_error_is_reported_with_exit_code_2(
    folder: Path, capsys: pytest.CaptureFixture[str], camera: str | None, options: list[str], complaint: str
) -> None:
    if camera is not None:
        (folder / "camera.toml").write_text(camera)
        options = ["--camera", str(folder / "camera.toml"), *options]
    before = sorted(folder.iterdir())
    assert run(folder, *options) == Exit.USER
    assert complaint in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before


def test_a_missing_folder_and_an_existing_recording_are_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    camera = ["--camera", str(folder / "camera.toml")]
    assert cli.main(["import", str(folder / "no"), "--layout", "pairs", "--out", "x.mcap", *camera]) == Exit.USER
    assert "no: no such folder" in capsys.readouterr().err
    (folder / "out.mcap").write_bytes(b"precious")
    assert run(folder, *camera) == Exit.USER
    assert "out.mcap: exists already" in capsys.readouterr().err
    assert (folder / "out.mcap").read_bytes() == b"precious"


def test_frames_that_are_not_there_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder, "--camera", str(folder / "camera.toml"), "--frames", "7:9") == Exit.USER
    assert "--frames 7:9: no image has such a number; there are 0 to 2" in capsys.readouterr().err
    assert run(folder, "--camera", str(folder / "camera.toml"), "--frames", "2:0") == Exit.USER
    assert "--frames 2:0: the first number is larger than the last one" in capsys.readouterr().err
    arguments = ["import", str(tmp_path), "--layout", "o3r", "--out", str(tmp_path / "x.mcap"), "--frames", "0:2"]
    assert cli.main(arguments) == Exit.USER
    assert "--frames: layout o3r takes no options but --out" in capsys.readouterr().err


@pytest.mark.parametrize("frames", ["a", "1:2:0", "1-2", "", "1:2:3:4", "-1:2"])
def test_frames_are_numbers_with_colons(folder: Path, capsys: pytest.CaptureFixture[str], frames: str) -> None:
    with pytest.raises(SystemExit) as exit_info:
        run(folder, f"--frames={frames}")
    assert exit_info.value.code == Exit.USER
    assert "must be FIRST:LAST or FIRST:LAST:STEP" in capsys.readouterr().err


@pytest.mark.parametrize("rate", ["0", "fast", "nan"])
def test_a_rate_is_a_number(folder: Path, capsys: pytest.CaptureFixture[str], rate: str) -> None:
    with pytest.raises(SystemExit) as exit_info:
        run(folder, "--rate", rate)
    assert exit_info.value.code == Exit.USER
    assert f"'{rate}' must be a number from 0.001 to 10000" in capsys.readouterr().err
