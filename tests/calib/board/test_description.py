"""Boards with markers that are not as described are named, and boards that are as described are not."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calib import pose
from calib.board.corners.description import mismatch
from calib.board.corners.detection import detect
from calib.board.corners.errors import NothingFoundError, OtherBoardError
from calib.board.corners.other_discs import other_discs
from calib.board.corners.to_8bit import grey
from calib.board.target import AprilGrid, AsymmetricCircles, Charuco, Chessboard, Circles, Dictionary
from evaluation.scenes.boards.board_images import VGA, as_bytes, centered, photograph

GRID = AprilGrid(6, 5, 0.03, 0.009)


@pytest.fixture(scope="module")
def grid() -> np.ndarray:
    return as_bytes(photograph(GRID, VGA, centered(GRID, (0.2, 0.1, 0.3), 0.42)))


@pytest.mark.parametrize("described", [AprilGrid(5, 6, 0.03, 0.009), AprilGrid(7, 5, 0.03, 0.009)])
def test_a_grid_with_other_columns_is_refused(grid: np.ndarray, described: AprilGrid) -> None:
    with pytest.raises(OtherBoardError, match=f"not stand as on a board of {described.columns} × {described.rows}"):
        detect(described, grid)


@pytest.mark.parametrize("described", [AprilGrid(5, 6, 0.03, 0.009), AprilGrid(7, 5, 0.03, 0.009)])
def test_a_grid_with_other_columns_is_refused_if_no_tag_has_a_neighbour(grid: np.ndarray, described: AprilGrid) -> None:
    """Such an image was taken, with corners in the wrong places."""
    corners = VGA.project(pose.transform(centered(GRID, (0.2, 0.1, 0.3), 0.42), GRID.points()))
    covered = grid.copy()
    for number in {*range(30)} - {0, 2, 4, 12, 14, 16, 24, 26, 28}:
        cv2.fillConvexPoly(covered, np.rint(corners[GRID.ids_of_tag(number)]).astype(np.int32), 120)
    assert len(detect(GRID, covered).ids) > 24
    with pytest.raises(OtherBoardError, match=f"not stand as on a board of {described.columns} × {described.rows}"):
        detect(described, covered)


def test_a_grid_with_other_gaps_is_refused_with_both(grid: np.ndarray) -> None:
    with pytest.raises(OtherBoardError, match=r"0\.30 of a tag wide, but 0\.50 as described"):
        detect(AprilGrid(6, 5, 0.03, 0.015), grid)


def test_a_grid_says_which_columns_it_has(grid: np.ndarray) -> None:
    assert (
        mismatch(AprilGrid(5, 6, 0.03, 0.009), grid) == "fits with columns and rows exchanged, 6 × 5 instead of 5 × 6"
    )
    assert mismatch(AprilGrid(6, 4, 0.03, 0.009), grid).endswith("ids up to 29, a board of 6 × 4 has 0 to 23")
    assert mismatch(GRID, grid) == ""
    assert mismatch(Charuco(7, 5, 0.03, 0.022, "apriltag_36h11"), grid) == "shows an AprilGrid"


@pytest.mark.parametrize(("columns", "rows"), [(7, 6), (8, 6)])
def test_the_pattern_of_an_older_opencv_is_named(columns: int, rows: int) -> None:
    board = Charuco(columns, rows, 0.03, 0.022, "4x4_50")
    printed = cv2.aruco.CharucoBoard((columns, rows), board.square, board.marker, board.markers())
    printed.setLegacyPattern(True)
    older = replace(board, legacy=True)
    size = (60 * columns, 60 * rows)
    image = grey(printed.generateImage(size, marginSize=20))
    assert mismatch(board, image).endswith("even number of rows (legacy = true)")
    assert mismatch(older, image) == ""
    assert len(detect(older, image).ids) == len(board.points())
    printed.setLegacyPattern(False)
    image = grey(printed.generateImage(size, marginSize=20))
    assert mismatch(board, image) == ""
    assert mismatch(older, image).endswith("is black (without legacy)")


def test_black_and_white_exchanged_are_named(grid: np.ndarray) -> None:
    assert mismatch(GRID, 255 - grid) == "shows markers in white on black instead of black on white"


def test_an_image_without_markers_says_nothing() -> None:
    assert mismatch(GRID, np.full((120, 160), 128, np.uint8)) == ""


def test_a_white_wall_around_another_board_is_not_said_to_saturate_it() -> None:
    image = as_bytes(photograph(GRID, VGA, centered(GRID, (0, 0, 0), 0.4)))
    image[image > 90] = 255
    with pytest.raises(NothingFoundError, match="bright as the sensor can tell, which may be why"):
        detect(Chessboard(9, 6, 0.03), image)


def test_a_whole_board_of_another_size_near_the_border_is_not_said_to_be_cut_off() -> None:
    board = Chessboard(9, 6, 0.03)
    T_sb = centered(board, (0, 0, 0), 0.8)
    T_sb[0, 3] -= 0.27
    with pytest.raises(NothingFoundError):
        detect(Chessboard(8, 5, 0.03), as_bytes(photograph(board, VGA, T_sb)))


def test_a_grid_that_begins_with_another_number_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    printed = cv2.aruco.generateImageMarker
    monkeypatch.setattr(
        cv2.aruco,
        "generateImageMarker",
        lambda tags, number, *size, **border: printed(tags, number + 1, *size, **border),
    )
    image = as_bytes(photograph(GRID, VGA, centered(GRID, (0.2, 0.1, 0.3), 0.42)))
    with pytest.raises(OtherBoardError, match="with number 0 in the lower left corner"):
        detect(GRID, image)


@pytest.mark.parametrize(("name", "tags"), [("DICT_6X6_250", "6x6_50"), ("DICT_APRILTAG_36h11", "apriltag_36h11")])
def test_single_markers_are_not_taken_for_a_charuco(name: str, tags: str) -> None:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    image = grey(cv2.aruco.GridBoard((7, 5), 0.03, 0.006, dictionary).generateImage((640, 460), marginSize=12))
    for board in (AprilGrid(7, 5, 0.03, 0.006), Chessboard(7, 5, 0.03), Charuco(7, 5, 0.03, 0.022, "4x4_50")):
        reported = f"shows single markers of the dictionary {tags} without a chessboard, which are not supported"
        assert mismatch(board, image) == reported


@pytest.mark.parametrize(
    ("name", "first", "border", "described", "reported"),
    [
        ("DICT_5X5_100", 0, 2, "5x5_100", "shows markers with a black frame of 2 cells; a ChArUco has 1 here"),
        ("DICT_4X4_1000", 500, 1, "4x4_50", "markers of the dictionary 4x4_1000, the description says 4x4_50"),
        (
            "DICT_5X5_100",
            30,
            1,
            "5x5_50",
            "markers with ids from 30 to 46, a board of 7 × 5 has 0 to 16: is first_id right?",
        ),
        ("DICT_ARUCO_MIP_36h12", 0, 1, "5x5_50", "the dictionary mip_36h12, the description says 5x5_50"),
        ("DICT_ARUCO_MIP_36h12", 0, 1, "mip_36h12", ""),
    ],
)
def test_markers_of_an_unusual_print_are_named(
    name: str, first: int, border: int, described: Dictionary, reported: str
) -> None:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    printed = cv2.aruco.CharucoBoard((7, 5), 0.03, 0.022, dictionary, np.arange(first, first + 17))
    image = grey(printed.generateImage((900, 640), marginSize=20, borderBits=border))
    assert mismatch(Charuco(7, 5, 0.03, 0.022, described), image).endswith(reported)


def test_columns_and_rows_are_exchanged_only_if_the_last_row_is_there() -> None:
    square = AprilGrid(6, 6, 0.03, 0.009)
    image = as_bytes(photograph(square, VGA, centered(square, (0.2, 0.1, 0.3), 0.45)))
    reported = "shows markers with ids up to 35 that stand as on a board of 6 columns, not of 7 × 6"
    assert mismatch(AprilGrid(7, 6, 0.03, 0.009), image) == reported


@pytest.mark.parametrize(
    ("described", "reported"),
    [
        (Circles(8, 5, 0.02, 0.012), "shows a grid of 7 × 5 discs"),
        (AsymmetricCircles(7, 5, 0.02, 0.012), "shows a grid of 7 × 5 discs"),
    ],
)
def test_the_grid_of_discs_that_is_there_is_named(described: Circles | AsymmetricCircles, reported: str) -> None:
    board = Circles(7, 5, 0.02, 0.012)
    assert other_discs(described, as_bytes(photograph(board, VGA, centered(board, (0.2, 0.1, 0.1), 0.25)))) == reported


def test_discs_in_shifted_rows_are_no_regular_grid() -> None:
    board = AsymmetricCircles(4, 11, 0.015, 0.012)
    image = as_bytes(photograph(board, VGA, centered(board, (0.2, 0.1, 1.5), 0.25)))
    assert other_discs(Circles(4, 11, 0.015, 0.012), image) == "shows an asymmetric grid of 4 × 11 discs"
    assert other_discs(board, 255 - image) == "shows white discs on black instead of black ones on white"


@pytest.mark.parametrize(("columns", "rows"), [(7, 5), (8, 6)])
def test_a_charuco_whose_markers_begin_with_another_number_has_a_key(columns: int, rows: int) -> None:
    """As OpenCV prints and finds the second of several boards."""
    described = Charuco(columns, rows, 0.03, 0.022, "5x5_100", first_id=30)
    ids = np.arange(30, 30 + columns * rows // 2)
    printed = cv2.aruco.CharucoBoard((columns, rows), 0.03, 0.022, described.markers(), ids)
    image = grey(printed.generateImage((100 * columns, 100 * rows)))
    found = detect(described, image)
    corners, numbers, _, _ = cv2.aruco.CharucoDetector(printed).detectBoard(image)
    assert found.ids.tolist() == numbers.ravel().tolist() == [*range((columns - 1) * (rows - 1))]
    assert np.abs(found.pixels - corners.reshape(-1, 2)).max() < 0.3
    assert mismatch(described, image) == ""
    assert "is first_id right?" in mismatch(replace(described, first_id=0), image)
    assert "is first_id right?" in mismatch(replace(described, first_id=40), image)
    drawn = as_bytes(photograph(described, VGA, centered(described, (0.2, 0.1, 0.3), 0.42)))
    assert len(detect(described, drawn).ids) > 0.9 * len(found.ids)


def test_a_first_number_beyond_the_dictionary_is_refused() -> None:
    with pytest.raises(ValueError, match="first_id: 90 must be from 0 to 83, as 5x5_100 has 100 markers"):
        Charuco(7, 5, 0.03, 0.022, "5x5_100", first_id=90)


@pytest.mark.parametrize(("columns", "rows", "more"), [(7, 6, "columns"), (8, 5, "rows"), (6, 6, "columns")])
def test_a_part_of_a_grid_of_discs_is_not_taken_for_the_board(columns: int, rows: int, more: str) -> None:
    """One sensor saw other discs than another: a pair with 30 mm spacing was trusted, or one shot was off by 30 mm."""
    printed = Circles(8, 6, 0.03, 0.015)
    image = as_bytes(photograph(printed, VGA, centered(printed, (0.35, -0.4, 0.2), 0.6)))
    assert len(detect(printed, image).ids) == 48
    with pytest.raises(OtherBoardError, match=f"has more {more} than the {columns} × {rows} of the description"):
        detect(Circles(columns, rows, 0.03, 0.015), image)


@pytest.mark.parametrize("target", [GRID, Charuco(7, 5, 0.03, 0.022, "4x4_50")], ids=repr)
def test_two_copies_of_a_board_are_named(target: AprilGrid | Charuco) -> None:
    """Columns and rows were doubted, or focus and light."""
    images = [as_bytes(photograph(target, VGA, centered(target, (0.2, tilt, 0.1), 0.6))) for tilt in (0.2, -0.4)]
    with pytest.raises(OtherBoardError, match="more than one board"):
        detect(target, np.hstack(images))
