"""Forms in which people have depth, colours and times are imported, or it is said why not."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.images.importing import CAMERA, COLOR, frames_of, run


@pytest.mark.parametrize(("scale", "metres"), [("", 1.25), ("depth_scale = 0.001\n", 0.00125)])
@pytest.mark.parametrize("form", ["tiff", "npy32", "npy64"])
def test_floating_point_depth_is_in_metres_unless_its_scale_is_said(tmp_path: Path, form, scale, metres) -> None:
    depth = np.full((3, 4), 1.25, np.float64 if form == "npy64" else np.float32)
    depth[0] = np.nan, np.inf, 0.0, -1.0
    if form == "tiff":
        assert cv2.imwrite(str(tmp_path / "depth_0.tiff"), depth)
    else:
        np.save(tmp_path / "depth_0.npy", depth)
    (tmp_path / "camera.toml").write_text(CAMERA + scale)
    camera = str(tmp_path / "camera.toml")
    assert run(tmp_path, "--camera", camera, "--depth", "depth_0.*") == Exit.OK
    (frame,) = frames_of(tmp_path / "out.mcap")
    assert np.isnan(frame.si()[0]).all()
    np.testing.assert_allclose(frame.si()[1:], metres, rtol=1e-6)


def test_a_stack_of_images_is_no_image(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "depth_0.npy", np.ones((5, 3, 4), np.float32))
    (tmp_path / "camera.toml").write_text(CAMERA)
    assert run(tmp_path, "--camera", str(tmp_path / "camera.toml"), "--depth", "*.npy") == Exit.USER
    assert "has the shape (height, width), this is (5, 3, 4); save each one" in capsys.readouterr().err


def timed(folder: Path, depth: list[str], color: list[str]) -> list[str]:
    """Images with these names, each with a mask of its own; the options that import them."""
    for name in ("depth", "rgb", "masks"):
        (folder / name).mkdir()
    for name in depth:
        cv2.imwrite(str(folder / "depth" / f"{name}.png"), np.full((3, 4), 1000, np.uint16))
        cv2.imwrite(str(folder / "masks" / f"{name}.png"), np.eye(3, 4, dtype=np.uint8))
    for name in color:
        cv2.imwrite(str(folder / "rgb" / f"{name}.png"), np.zeros((3, 4, 3), np.uint8))
    (folder / "camera.toml").write_text(CAMERA + COLOR)
    patterns = ["--depth", "depth/*", "--color", "rgb/*", "--mask", "masks/*"]
    return ["--camera", str(folder / "camera.toml"), *patterns]


def test_images_with_times_in_their_names_are_paired_by_them(tmp_path: Path, capsys) -> None:
    depth = ["1700000000.900000", "1700000000.933333", "1700000000.966667", "1700000001.000000"]
    options = timed(tmp_path, depth, ["1700000000.909000", "1700000001.009000"])
    assert run(tmp_path, *options) == Exit.OK
    note = "note: 2 of 4 depth images have no colour image within 0.0167 s, as "
    assert f"{note}{tmp_path / 'depth' / depth[1]}.png" in capsys.readouterr().err
    frames = frames_of(tmp_path / "out.mcap")
    assert [(frame.sensor, frame.seq, frame.t_host_ns - 1_700_000_000_000_000_000) for frame in frames] == [
        ("depth", 0, 900_000_000),
        ("color", 0, 909_000_000),
        ("depth", 1, 933_333_000),
        ("depth", 2, 966_667_000),
        ("depth", 3, 1_000_000_000),
        ("color", 1, 1_009_000_000),
    ]
    np.testing.assert_array_equal(np.isfinite(frames[3].si()), np.eye(3, 4, dtype=bool))


@pytest.mark.parametrize(
    ("depth", "color", "options", "complaint"),
    [
        (["1700000000100"], ["7"], [], "7.png: its name has no time, as that of 1700000000100.png; lists of times and"),
        (["1700000000100"], ["1700000009100"], [], "begin 9 s apart; are the times of both in one unit, and of one cl"),
        (["1700000000100"], ["1700000000100"], ["--rate", "30"], "--rate: the names of images have times, such as 17"),
        (["200", "201"], ["0", "1"], [], "no colour image has the number of a depth image: 200.png to 201.png and 0.p"),
    ],
)
def test_streams_that_do_not_belong_together_are_refused(tmp_path: Path, capsys, depth, color, options, complaint):
    assert run(tmp_path, *timed(tmp_path, depth, color), *options) == Exit.USER
    assert complaint in capsys.readouterr().err


def test_what_has_no_colour_image_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    note = "note: 1 of 3 depth images have no colour image of their number, as "
    assert f"{note}{folder / 'depth_001.png'}" in capsys.readouterr().err


def test_times_of_another_unit_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = timed(tmp_path, ["0.000000", "33333.000000"], ["0.000000", "33333.000000"])
    assert run(tmp_path, *options) == Exit.OK
    assert "depth images are 3.33e+04 s apart (median): are their times in another unit?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "metres"), [([], 1.0), (["--depth-scale", "0.0002"], 0.2), (["--depth-scale", "0.001"], 1.0)]
)
def test_the_distance_is_told_so_that_a_wrong_scale_is_seen(folder: Path, capsys, options, metres) -> None:
    assert run(folder, "--camera", str(folder / "camera.toml"), *options) == Exit.OK
    unit = options[-1] if options else "0.001"
    assert f"depth_000.png: median distance {metres:g} m, at {unit} m a unit; --depth" in capsys.readouterr().out
    np.testing.assert_allclose(frames_of(folder / "out.mcap")[0].si(), metres, rtol=1e-6)


def test_an_image_without_distances_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(folder / "depth_000.png"), np.zeros((3, 4), np.uint16))
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    assert "depth_000.png: no distance in it, at 0.001 m a unit" in capsys.readouterr().out


def test_the_largest_value_is_asked_about_unless_it_is_said_to_be_no_return(folder: Path, capsys) -> None:
    cv2.imwrite(str(folder / "depth_000.png"), np.array([[65535, 65535, 700, 700]] * 3, np.uint16))
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    assert "depth_000.png: 50% of its pixels have 65535, the largest value; if" in capsys.readouterr().err
    (folder / "camera.toml").write_text(CAMERA + "invalid = 65535\n" + COLOR)
    (folder / "out.mcap").unlink()
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    captured = capsys.readouterr()
    assert "65535" not in captured.err
    assert "depth_000.png: median distance 0.7 m" in captured.out
