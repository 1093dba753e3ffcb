"""Searches for boards in images of several sizes."""

import cv2
import numpy as np
import pytest

from calib.board.corners.detection import detect
from calib.board.corners.errors import TooSmallError
from calib.board.corners.search import chessboard_size, find
from calib.board.target import Charuco, Chessboard, Circles
from calib.pose import transform
from evaluation.scenes.boards.board_images import VGA, as_bytes, centered, photograph

CHESSBOARD = Chessboard(9, 6, 0.03)
CHARUCO = Charuco(10, 7, 0.03, 0.0225, "4x4_100")


def test_a_small_board_in_a_large_image_is_found_though_the_first_searches_reduce_it() -> None:
    board = as_bytes(photograph(CHESSBOARD, VGA, centered(CHESSBOARD, (0.1, 0.2, 0), 550 * CHESSBOARD.square / 6)))
    image = np.full((1200, 1600), 128, np.uint8)
    image[500:980, 700:1340] = board
    ids, pixels = find(CHESSBOARD, image)
    assert len(ids) == 54
    np.testing.assert_allclose(pixels - (700, 500), find(CHESSBOARD, board)[1], atol=0.5)


def test_small_markers_are_found_in_images_of_16_bits_as_in_those_of_8() -> None:
    """By the square root alone 14 corners of 39 were found, and none in noisier images."""
    image = as_bytes(photograph(CHARUCO, VGA, centered(CHARUCO, (0.35, -0.4, 0.2), 0.9)))
    found = detect(CHARUCO, image), detect(CHARUCO, image.astype(np.uint16) * 257)
    assert len(found[1].ids) >= 0.9 * len(found[0].ids) > 30
    common = np.intersect1d(found[0].ids, found[1].ids, return_indices=True)[1:]
    np.testing.assert_allclose(found[0].pixels[common[0]], found[1].pixels[common[1]], atol=0.1)


@pytest.mark.parametrize(("square_px", "minimum"), [(14, 27), (17, 40)])
def test_a_charuco_of_small_squares_is_found_in_an_enlarged_image(square_px: float, minimum: int) -> None:
    """In the image itself 2 and 20 corners of 54 are; in an enlarged one, 34 and 47."""
    T_sb = centered(CHARUCO, (0.35, -0.4, 0.2), VGA.fx * CHARUCO.square / square_px)
    found = detect(CHARUCO, as_bytes(photograph(CHARUCO, VGA, T_sb)))
    assert len(found.ids) >= minimum
    error = found.pixels - VGA.project(transform(T_sb, CHARUCO.points()))[found.ids]
    assert np.sqrt(np.mean(error**2)) < 0.1


def test_a_charuco_whose_markers_cannot_be_read_is_too_small() -> None:
    """It was not found, and its markers were taken for a chessboard of 3 × 3 corners."""
    image = as_bytes(photograph(CHARUCO, VGA, centered(CHARUCO, (0.35, -0.4, 0.2), VGA.fx * CHARUCO.square / 10)))
    with pytest.raises(TooSmallError, match=r"cells of its markers are 1\.0 pixels wide, at least 2 are needed"):
        detect(CHARUCO, image)
    assert chessboard_size(image) == (0, 0)


def test_an_image_with_too_few_pixels_for_the_discs_of_a_board_shows_none() -> None:
    """OpenCV's own error ended the calibration."""
    ids, _ = find(Circles(16, 16, 0.02, 0.01), np.full((48, 64), 128, np.uint8))
    assert not len(ids)


@pytest.mark.parametrize("angle", [0, 4, 10])
def test_a_dark_frame_around_a_chessboard_is_no_further_row_of_squares(angle: int) -> None:
    """As around the screen of a tablet: 10 × 6, 9 × 7 and 9 × 8 corners were counted, in most of the images."""
    rows, columns = np.indices((7 * 26, 10 * 26)) // 26
    board = np.where((rows + columns) % 2 == 0, 30, 220).astype(np.uint8)
    image = np.pad(np.pad(np.pad(board, 5, constant_values=220), 14, constant_values=25), 60, constant_values=180)
    size = (image.shape[1], image.shape[0])
    turn = cv2.getRotationMatrix2D((size[0] / 2, size[1] / 2), angle, 1.0)
    blurred = cv2.GaussianBlur(cv2.warpAffine(image, turn, size, borderValue=180), (0, 0), 0.8)
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0, 2, image.shape)
        longer, shorter = chessboard_size(np.clip(blurred + noise, 0, 255).astype(np.uint8))
        assert longer <= 9
        assert shorter <= 6
