"""Searches for boards in images of several sizes."""

import numpy as np

from calib.board.corners.search import find
from calib.board.target import Chessboard
from tests.calib.board.boards import VGA, as_bytes, centered, photograph

CHESSBOARD = Chessboard(9, 6, 0.03)


def test_a_small_board_in_a_large_image_is_found_though_the_first_searches_reduce_it() -> None:
    board = as_bytes(photograph(CHESSBOARD, VGA, centered(CHESSBOARD, (0.1, 0.2, 0), 550 * CHESSBOARD.square / 6)))
    image = np.full((1200, 1600), 128, np.uint8)
    image[500:980, 700:1340] = board
    ids, pixels = find(CHESSBOARD, image)
    assert len(ids) == 54
    np.testing.assert_allclose(pixels - (700, 500), find(CHESSBOARD, board)[1], atol=0.5)
