"""Images that no calibration can come from are counted and named, with what is wrong in them."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import target_file
from abs_service.calibration.shots import unseen
from abs_service.calibration.shots.shots import SensorShot, Shot
from calib.board.target import AprilGrid, Charuco, Chessboard, Target
from evaluation.calibration.simulated_board import scene
from evaluation.scenes.boards.board_images import VGA, as_bytes, centered, photograph


@pytest.fixture
def said(capsys, tmp_path: Path) -> Callable[..., str]:
    """Runs `calibrate intrinsics` with a board, which has to write no calibration; gives what it said."""

    def said(board: Target, *options: str) -> str:
        target_file.write(board, tmp_path / "board.toml")
        out = tmp_path / "out.toml"
        arguments = ["calibrate", "intrinsics", *options, "--target", str(tmp_path / "board.toml"), "--out", str(out)]
        assert cli.main(arguments) == 2
        assert not out.exists()
        return capsys.readouterr().err

    return said


def test_a_board_that_is_in_no_image_is_said_with_what_is_there(said, data_set: Callable[[str], Path]) -> None:
    images = f"left={data_set('calib_opencv_stereo')}/left0[1-4].jpg"
    error = said(Chessboard(10, 7, 0.025), "--images", images)
    assert "no board of 10 × 7 inner corners in any of 4 images: nothing found in 3" in error
    assert "3 images show a board of 9 × 6 inner corners: correct the description" in error


@pytest.mark.parametrize(("hidden", "reported"), [(1, False), (0, True)])
def test_a_board_of_which_only_a_part_is_found_is_not_suggested(
    said, tmp_path: Path, hidden: int, reported: bool
) -> None:
    board = Chessboard(9, 5, 0.025)
    for number in range(2):
        image = as_bytes(photograph(board, VGA, centered(board, (0.2, 0.1, 0.3 * number), 0.4)))
        if number < hidden:
            image = as_bytes(photograph(Chessboard(8, 4, 0.025), VGA, centered(board, (0.2, 0.1, 0.3), 0.4)))
        cv2.imwrite(str(tmp_path / f"c_{number}.png"), image)
    error = said(Chessboard(9, 6, 0.025), "--images", f"color={tmp_path}/c_*.png")
    assert ("2 images show a board of 9 × 5 inner corners" in error) == reported
    assert reported or "inner corners: correct" not in error


def test_a_board_with_more_corners_than_described_is_refused(said, data_set: Callable[[str], Path]) -> None:
    folder = data_set("calib_opencv_stereo")
    images = [word for side in ("left", "right") for word in ("--images", f"{side}={folder}/{side}*.jpg")]
    error = said(Chessboard(8, 6, 0.025), *images)
    assert "images show a board of 9 × 6 inner corners, more than the 8 × 6 of the description" in error


def test_only_images_that_agree_tell_that_a_board_has_more_corners() -> None:
    boards = [Chessboard(9, 6, 0.025), Chessboard(9, 6, 0.025), Chessboard(8, 6, 0.025)]
    images = [as_bytes(photograph(board, VGA, centered(board, (0.2, 0.1, 0.3), 0.4))) for board in boards]
    shots = [Shot(number, {"color": SensorShot(0, image, image)}) for number, image in enumerate(images)]
    assert "9 × 6 inner corners, more than the 6 × 8" in unseen.more_than_described(Chessboard(6, 8, 0.025), shots)
    assert not unseen.more_than_described(Chessboard(6, 8, 0.025), shots[1:])
    assert not unseen.more_than_described(Chessboard(6, 9, 0.025), shots)
    assert not unseen.more_than_described(Chessboard(10, 7, 0.025), shots)


PRINT = Charuco(7, 5, 0.03, 0.022, "5x5_50")

#: All that light leaves of it where white swallows the markers.
SQUARES = Chessboard(6, 4, 0.03)


@pytest.mark.parametrize(
    ("described", "reported"),
    [
        (Charuco(7, 5, 0.03, 0.022, "4x4_50"), "dictionary 5x5_50, the description says 4x4_50"),
        (Charuco(5, 7, 0.03, 0.022, "5x5_50"), "fits with columns and rows exchanged, 7 × 5 instead of 5 × 7"),
        (Charuco(9, 4, 0.03, 0.022, "5x5_50"), "ids up to 16 that stand as on a board of 7 columns, not of 9 × 4"),
    ],
)
def test_a_wrong_description_of_a_board_with_markers_is_named(
    said, tmp_path: Path, described: Target, reported: str
) -> None:
    shown = photograph(PRINT, VGA, centered(PRINT, (0.2, 0.1, 0.3), 0.45))
    cv2.imwrite(str(tmp_path / "c_1.png"), as_bytes(shown))
    assert f"{reported}: correct the description" in said(described, "--images", f"color={tmp_path}/c_*.png")


@pytest.mark.parametrize("board", [PRINT, Chessboard(8, 5, 0.025)])
def test_images_that_are_too_bright_or_too_dark_are_said_to_be_so(said, tmp_path: Path, board: Target) -> None:
    for number in range(2):
        image = as_bytes(photograph(SQUARES, VGA, centered(SQUARES, (0.2, 0.1, 0.3 * number), 0.35)))
        cv2.imwrite(str(tmp_path / f"bright_{number}.png"), np.where(image > 100, 255, 120).astype(np.uint8))
        cv2.imwrite(str(tmp_path / f"dark_{number}.png"), image // 100)
    error = said(board, "--images", f"color={tmp_path}/bright_*.png")
    unread = "" if board != PRINT else ", and no markers that can be read"
    assert f"2 images show a board of 6 × 4 inner corners{unread}: correct the description" in error
    assert "of image 0 is as bright as the sensor can tell: use a shorter exposure, or less light" in error
    error = said(board, "--images", f"color={tmp_path}/dark_*.png")
    assert "Image 0 is nearly black, 99% of it at most 2 of 255: use a longer exposure, or more light" in error


def test_images_without_a_board_are_counted_by_what_is_wrong(said, tmp_path: Path) -> None:
    for number in range(6):
        cv2.imwrite(str(tmp_path / f"c_{number}.png"), np.full((120, 160), 255 if number > 3 else 90, np.uint8))
    error = said(Chessboard(9, 6, 0.025), "--images", f"color={tmp_path}/c_*.png")
    assert "no board of 9 × 6 inner corners in any of 6 images: nothing found in 4, saturated in 2" in error
    report = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert report["verdict"] == "bad"
    assert report["verdicts"][0]["text"] in error.replace("\n", ".\n")


def test_stills_with_the_times_of_a_film_are_recognised(said, tmp_path: Path) -> None:
    board = scene("chessboard", "sensors=color", "rate=2", "seed=5", "color=320x240", "hold=0.1")
    for k in range(6):
        (frame,) = board.simulation.frames(4 * k)
        cv2.imwrite(str(tmp_path / f"color_{k}.png"), np.ascontiguousarray(frame.data[..., ::-1], np.uint8))
    camera = board.simulation.heads["color"].camera
    keys = f"width = 320\nheight = 240\nfx = {camera.fx}\nfy = {camera.fy}\ncx = {camera.cx}\ncy = {camera.cy}\n"
    (tmp_path / "camera.toml").write_text(f"[depth]\n{keys}[color]\n{keys}")
    for k in range(6):
        cv2.imwrite(str(tmp_path / f"depth_{k}.png"), np.zeros((240, 320), np.uint16))
    take = tmp_path / "take.mcap"
    arguments = ["import", str(tmp_path), "--layout", "pairs", "--camera", str(tmp_path / "camera.toml")]
    assert cli.main([*arguments, "--out", str(take)]) == 0
    assert "--rate 1" in said(board.target, str(take), "--every", "0")


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_a_truncated_image_is_named(said, tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"c_1.{suffix}"
    cv2.imwrite(str(file), np.random.default_rng(0).integers(0, 255, (120, 160), np.uint8))
    file.write_bytes(file.read_bytes()[:-2000])
    assert f"c_1.{suffix}: the image is truncated" in said(
        Chessboard(9, 6, 0.025), "--images", f"color={tmp_path}/c_*.{suffix}"
    )


def test_images_that_are_not_used_are_said_with_the_reason(said, tmp_path: Path) -> None:
    board = Chessboard(8, 5, 0.03)
    for number in range(4):
        image = as_bytes(photograph(board, VGA, centered(board, (0.3, 0.1 * number, 0.2 * number), 0.5)))
        cv2.imwrite(str(tmp_path / f"c_{number}.png"), cv2.GaussianBlur(image, (0, 0), 4.0 if number else 0.5))
    error = said(board, "--images", f"color={tmp_path}/c_*.png")
    assert "shot 0: color\n  shot 1: not color (blurred)\n" in error
    assert "to be reliable. Not used: blurred in 3" in error


@pytest.mark.parametrize(("content", "why"), [(b"", "it is empty"), (b"<html>", "no image of a known format")])
def test_a_file_that_is_no_image_is_said_in_plain_words(said, tmp_path: Path, content: bytes, why: str) -> None:
    (tmp_path / "c_0.png").write_bytes(content)
    error = said(Chessboard(8, 5, 0.03), "--images", f"color={tmp_path}/c_*.png")
    assert f"c_0.png: cannot be read as an image, {why}; PNG" in error


def test_a_board_of_which_too_few_images_show_a_part_is_named(said, tmp_path: Path) -> None:
    board = Chessboard(9, 6, 0.025)
    for number in range(3):
        shown = Chessboard(9, 5, 0.025) if number == 1 else board
        image = as_bytes(photograph(shown, VGA, centered(board, (0.2, 0.1, 0.3 * number), 0.4)))
        cv2.imwrite(str(tmp_path / f"c_{number}.png"), image)
    error = said(Chessboard(9, 5, 0.025), "--images", f"color={tmp_path}/c_*.png")
    assert "Not used: " in error
    assert "2 images show a board of 9 × 6 inner corners: correct the description" in error


def test_what_is_wrong_with_a_grid_and_what_to_do_about_a_mirror_is_said(said, tmp_path: Path) -> None:
    board = AprilGrid(4, 3, 0.03, 0.009)
    image = as_bytes(photograph(board, VGA, centered(board, (0.2, 0.1, 0.1), 0.3)))
    cv2.imwrite(str(tmp_path / "c_0.png"), image)
    cv2.imwrite(str(tmp_path / "m_0.png"), image[:, ::-1])
    error = said(AprilGrid(4, 3, 0.03, 0.02), "--images", f"color={tmp_path}/c_*.png")
    assert "not as described in 1. The gaps between the tags are 0.30 of a tag wide, but 0.67 as described" in error
    error = said(board, "--images", f"color={tmp_path}/m_*.png")
    assert "mirrored in 1. The board is seen as in a mirror: switch off the mirroring" in error


def test_one_image_of_three_that_shows_only_a_part_hides_no_other_board(said, tmp_path: Path) -> None:
    board = Chessboard(9, 6, 0.025)
    for number in range(4):
        shown = Chessboard(7, 5, 0.025) if number == 3 else board
        image = as_bytes(photograph(shown, VGA, centered(board, (0.2, 0.1, 0.3 * number), 0.4)))
        cv2.imwrite(str(tmp_path / f"c_{number}.png"), image)
    assert "2 images show a board of 9 × 6 inner corners" in said(
        Chessboard(10, 7, 0.025), "--images", f"color={tmp_path}/c_*.png"
    )
