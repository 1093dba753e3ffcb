"""Boards in real photographs: how many points are found, how well they repeat, and what they scatter by."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calib.board.corners.detection import Detection, detect
from calib.board.target import Charuco, Chessboard, Circles, Target

pytestmark = pytest.mark.slow

CHESSBOARD = Chessboard(9, 6, 0.025)
CIRCLES = Circles(10, 10, 0.0254, 0.0127)
CHARUCO = Charuco(14, 9, 0.04, 0.03, "5x5_250")


def images(folder: Path, pattern: str) -> list[NDArray[np.uint8]]:
    return [np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), np.uint8) for path in sorted(folder.glob(pattern))]


def repeatability(target: Target, image: NDArray[np.uint8], found: Detection) -> float:
    """Deviation of the corners from where they were, in the image shifted by parts of a pixel, with new noise [px]."""
    shift = np.array([0.37, -0.21])
    size = (image.shape[1], image.shape[0])
    motion = np.column_stack([np.eye(2), shift])
    moved = cv2.warpAffine(image, motion, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    noisy = moved + 2 * np.random.default_rng(1).standard_normal(moved.shape)
    again = detect(target, np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    common, first, second = np.intersect1d(found.ids, again.ids, return_indices=True)
    assert len(common) > 0.8 * len(found.ids)
    return float(np.sqrt(np.mean((again.pixels[second] - found.pixels[first] - shift) ** 2)))


def test_chessboards_of_a_stereo_camera(data_set: Callable[[str], Path]) -> None:
    pictures = images(data_set("calib_opencv_stereo"), "left*[0-9].jpg")
    found = [detect(CHESSBOARD, picture) for picture in pictures]
    assert [len(one.ids) for one in found] == 13 * [54]
    assert np.median([one.sigma_px for one in found]) < 0.1
    assert max(one.sigma_px for one in found) < 0.2
    assert np.median([repeatability(CHESSBOARD, *pair) for pair in zip(pictures[::6], found[::6])]) < 0.05


def test_circles_in_images_with_white_that_is_saturated(data_set: Callable[[str], Path]) -> None:
    pictures = images(data_set("calib_rct_circles") / "images", "*.png")
    found = [detect(CIRCLES, picture) for picture in pictures]
    assert [len(one.ids) for one in found] == 15 * [100]
    assert np.median([one.sigma_px for one in found]) < 0.07
    assert np.median([repeatability(CIRCLES, *pair) for pair in zip(pictures[::5], found[::5])]) < 0.06


def test_a_charuco_board_in_colour_and_in_infra_red(data_set: Callable[[str], Path]) -> None:
    folder = data_set("calib_azure_charuco") / "example_files"
    (color,), (infrared,) = images(folder / "registration", "color-0.jpg"), images(folder / "registration", "ir-0.png")
    (part,) = images(folder / "calibration", "color-12.jpg")
    assert color.shape == (3072, 4096, 3)
    found = {name: detect(CHARUCO, image) for name, image in (("color", color), ("ir", infrared), ("part", part))}
    assert {name: len(one.ids) for name, one in found.items()} == {"color": 104, "ir": 91, "part": 62}
    assert found["color"].sigma_px < 0.12
    assert found["ir"].sigma_px < 0.1
    assert repeatability(CHARUCO, infrared, found["ir"]) < 0.05
    # Both cameras look the same way, so that rows of corners run the same way in both.
    for one in (found["color"], found["ir"]):
        row = one.pixels[np.isin(one.ids, (52, 53, 54, 55))]
        assert np.all(np.diff(row[:, 0]) > 0)
