"""Saved detections: read as they were written, refused if they are of something else, and solved without images."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import corner_file, mrcal_corners, rig_file, target_file
from abs_service.calibration.files.corner_file import CornerFileError
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.commands.calibrate.inputs import calibrations
from abs_service.report.provenance import Provenance
from calib.board.target import Chessboard
from calib.formats import vnl
from evaluation.scenes.boards import board_views

BOARD = Chessboard(board_views.COLUMNS, board_views.ROWS, board_views.SQUARE)


@pytest.fixture(scope="module")
def seen() -> BoardObservations:
    heads = {name: head for name, head in board_views.three_heads().items() if name != "tof"}
    random = np.random.default_rng(5)
    found = board_views.look(heads, board_views.random_boards(14, random), random)
    sizes = {name: (head.camera.width, head.camera.height) for name, head in heads.items()}
    return BoardObservations(tuple(found.corners), tuple(found.planes), {}, sizes)


def test_what_is_written_is_read(seen: BoardObservations, tmp_path: Path) -> None:
    path = corner_file.path_beside(tmp_path / "lab.calibration.toml")
    assert path.name == "lab.calibration.corners.npz"
    corner_file.write(seen, path)
    read = corner_file.read(path, BOARD)
    assert read.sizes == seen.sizes
    assert (len(read.corners), len(read.planes)) == (len(seen.corners), len(seen.planes))
    for own, other in zip((*read.corners, *read.planes), (*seen.corners, *seen.planes), strict=True):
        assert (own.sensor, own.shot, own.t_s) == (other.sensor, other.shot, other.t_s)
        np.testing.assert_array_equal(own.pixels, other.pixels)
    assert read.corners[3].sigma_px == seen.corners[3].sigma_px
    np.testing.assert_array_equal(read.planes[-1].distances, seen.planes[-1].distances)


def test_what_is_not_of_this_board_or_damaged_is_refused(seen: BoardObservations, tmp_path: Path) -> None:
    path = tmp_path / "a.corners.npz"
    corner_file.write(seen, path)
    with pytest.raises(CornerFileError, match=r"a\.corners\.npz: its corners are not those of the board"):
        corner_file.read(path, Chessboard(9, 7, 0.041))
    np.savez(tmp_path / "b.corners.npz", version=np.array(1), sensors=np.array(["a"]))
    for name, content in (("c", b"no archive"), ("d", path.read_bytes()[:500])):
        (tmp_path / f"{name}.corners.npz").write_bytes(content)
    lost = [replace(view, pixels=np.full_like(view.pixels, np.nan)) for view in seen.corners]
    corner_file.write(replace(seen, corners=tuple(lost)), tmp_path / "f.corners.npz")
    exact = [replace(view, sigmas=np.zeros_like(view.sigmas)) for view in seen.planes]
    corner_file.write(replace(seen, planes=tuple(exact)), tmp_path / "g.corners.npz")
    for name, why in (
        ("b", "damaged"),
        ("g", "is damaged: a deviation is not above 0"),
        ("f", "is damaged: corner_pixels holds values that are no numbers"),
        ("c", "no file of detections"),
        ("d", "no file"),
        ("e", "cannot be read"),
    ):
        with pytest.raises(CornerFileError, match=rf"{name}\.corners\.npz: .*{why}"):
            corner_file.read(tmp_path / f"{name}.corners.npz", BOARD)


def test_a_rig_is_solved_again_without_images_and_with_other_options(
    seen: BoardObservations, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    corner_file.write(seen, tmp_path / "board.corners.npz")
    target_file.write(BOARD, tmp_path / "board.toml")
    given = [str(tmp_path / "board.corners.npz"), "--target", str(tmp_path / "board.toml")]
    out = tmp_path / "lab.toml"
    options = ["--fix", "color=k3,aspect", "--skip", "0", "--needed", "5", "--out", str(out)]
    assert cli.main(["calibrate", "rig", *given, *options]) in (0, 1), capsys.readouterr().err
    said = capsys.readouterr().out
    assert f"wrote {out}" in said
    color = calibrations.load(out).sensors["color"].camera
    assert color.lens.coefficients[4] == 0
    assert color.fx == pytest.approx(color.fy, rel=1e-12)
    line = r"^light: fx \d+\.?\d* ± \d+\.?\d*, fy .*, corners miss by 0\.\d+ px, boards \S+ to \S+ m away$"
    assert re.search(line, said, re.MULTILINE)
    report = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))
    assert {view["shot"] for view in report["values"]["views"]} == set(range(1, 14))


def test_images_that_were_all_stretched_are_said(
    seen: BoardObservations, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    views = [replace(view, pixels=view.pixels * (1, 1.03)) for view in seen.corners if view.sensor == "color"]
    width, height = seen.sizes["color"]
    corner_file.write(
        BoardObservations(tuple(views), (), {}, {"color": (width, height + 32)}), tmp_path / "b.corners.npz"
    )
    target_file.write(BOARD, tmp_path / "b.toml")
    given = [str(tmp_path / "b.corners.npz"), "--target", str(tmp_path / "b.toml")]
    cli.main(["calibrate", "intrinsics", *given, "--out", str(tmp_path / "c.toml")])
    assert re.search(r"; fy is 1\.0[23]\d times fx, as of images that were stretched", capsys.readouterr().out)


def test_what_cannot_be_fixed_is_named(
    seen: BoardObservations, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    corner_file.write(seen, tmp_path / "board.corners.npz")
    target_file.write(BOARD, tmp_path / "board.toml")
    given = [str(tmp_path / "board.corners.npz"), "--target", str(tmp_path / "board.toml")]
    for fix, why in (
        ("k9", "--fix k9: allowed: aspect, cx"),
        ("left=k3", "--fix left=k3: no sensor that saw the board"),
    ):
        assert cli.main(["calibrate", "rig", *given, "--fix", fix, "--out", str(tmp_path / "x.toml")]) == 2
        assert why in capsys.readouterr().err
    assert not (tmp_path / "x.toml").exists()


VNL = """## mrgingham
# filename x y level
images/left-1.png - -
images/left-2.png 10.5 20 0
images/left-2.png 30 20.25 -
images/left-2.png 30 40.25 -1
"""


def test_a_table_of_mrcal_has_points_that_are_missing_or_ignored() -> None:
    read = vnl.read(VNL)
    assert [*read] == ["images/left-1.png", "images/left-2.png"]
    np.testing.assert_array_equal(read["images/left-2.png"], [[10.5, 20], [np.nan] * 2, [np.nan] * 2])
    for wrong, why in (("a 1 2 0\n", "line 1"), ("# filename x y level\na 1 b 0\n", "line 2"), ("", "legend")):
        with pytest.raises(vnl.VnlError, match=why):
            vnl.read(wrong)


def test_corners_of_mrcal_are_solved_without_images(
    seen: BoardObservations, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "corners.vnl"
    mrcal_corners.write(seen, BOARD, path)
    read = mrcal_corners.read(path, BOARD, {name: f"{name}-*" for name in seen.sizes}, seen.sizes)
    for own, other in zip(read.corners, seen.corners, strict=True):
        assert (own.sensor, own.shot) == (other.sensor, other.shot)
        np.testing.assert_allclose(own.points_b, other.points_b)
        np.testing.assert_allclose(own.pixels, other.pixels, atol=1e-6)
    target_file.write(BOARD, tmp_path / "board.toml")
    common = ["calibrate", "intrinsics", str(path), "--target", str(tmp_path / "board.toml")]
    common += ["--out", str(tmp_path / "x.toml")]
    given = [*common, "--images", "color=color-*"]
    assert cli.main(given) == 2
    assert "--size color=WxH" in capsys.readouterr().err
    given += ["--size", "color=1280x720"]
    assert cli.main([*common, "--images", "c=left-*", "--size", "c=1280x720"]) == 2
    assert "has a name that --images matches; names: " in capsys.readouterr().err
    assert cli.main(given) in (0, 1)
    truth = board_views.three_heads()["color"].camera
    assert calibrations.load(tmp_path / "x.toml").sensors["color"].camera.fx == pytest.approx(truth.fx, rel=0.01)


def test_a_calibration_is_verified_by_saved_detections(
    seen: BoardObservations, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heads = board_views.three_heads()
    cameras = {name: heads[name].camera for name in seen.sizes}
    zoomed = {**cameras, "color": replace(cameras["color"], fx=930.0, fy=928.5)}
    smaller = {**cameras, "color": replace(cameras["color"], width=640)}
    corner_file.write(seen, tmp_path / "new.corners.npz")
    target_file.write(BOARD, tmp_path / "board.toml")
    given = [str(tmp_path / "new.corners.npz"), "--target", str(tmp_path / "board.toml")]
    for name, stored, code, said in (
        ("lab", cameras, 0, "light and color"),
        ("zoomed", zoomed, 2, "color"),
        ("smaller", smaller, 2, "images of color have 1280 × 720 pixels, but its camera in "),
    ):
        sensors = {sensor: rig_file.SensorCalibration(camera) for sensor, camera in stored.items()}
        rig_file.write(
            rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-21")), tmp_path / f"{name}.toml"
        )
        assert cli.main(["calibrate", "verify", str(tmp_path / f"{name}.toml"), *given]) == code, name
        assert said in "".join(capsys.readouterr())
    assert cli.main(["calibrate", "verify", str(tmp_path / "lab.toml"), *given, "--skip", "99"]) == 2
    assert "there is no shot 99" in capsys.readouterr().err
