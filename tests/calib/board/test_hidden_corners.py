"""Corners that are hidden, such as by a finger, a highlight or a stain."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calib import pose
from calib.board.corners import errors
from calib.board.corners.detection import detect
from calib.board.target import AprilGrid, Charuco, Chessboard, Circles, Target
from calib.camera import Camera
from evaluation.scenes.boards.board_images import VGA, as_bytes, board_pose, centered, photograph

BOARDS = [Chessboard(9, 6, 0.03), Charuco(10, 7, 0.03, 0.0225, "4x4_100")]


@pytest.fixture(scope="module", params=BOARDS, ids=repr)
def board(request: pytest.FixtureRequest) -> tuple[Target, NDArray[np.uint8], NDArray[np.float64]]:
    """A board, an image of it without noise, and where its corners are [px]."""
    target: Target = request.param
    T_sb = centered(target, (0.35, -0.4, 0.2), 0.5)
    corners = VGA.project(pose.transform(T_sb, target.points()))
    return target, as_bytes(photograph(target, VGA, T_sb, noise=0.0)), corners


@pytest.mark.parametrize("hidden", [0, 8, 22])
@pytest.mark.parametrize("level", [30, 120, 200])
@pytest.mark.parametrize("noise", [0, 4])
def test_a_hidden_corner_is_left_out_and_not_guessed(
    board: tuple[Target, NDArray[np.uint8], NDArray[np.float64]], hidden: int, level: int, noise: int
) -> None:
    """OpenCV's searches fill a chessboard with what they expect, up to 26 px beside it; noise is full of saddles."""
    target, image, corners = board
    square_px = np.linalg.norm(corners[1] - corners[0])
    middle = np.rint(corners[hidden]).astype(int).tolist()
    grain = np.random.default_rng(0).normal(0.0, noise, image.shape).astype(np.float32)
    for share in (0.3, 0.6):
        stained = cv2.circle(image.copy(), middle, int(share * square_px), level, -1)
        try:
            found = detect(target, as_bytes(stained + grain))
        except errors.NothingFoundError:
            continue
        assert hidden not in found.ids
        assert len(found.ids) > 0.8 * len(corners)
        assert np.abs(found.pixels - corners[found.ids]).max() < 0.2


@pytest.mark.parametrize("target", [AprilGrid(6, 5, 0.03, 0.009), BOARDS[1]], ids=repr)
@pytest.mark.parametrize("up", [0.0075, 0.015, 0.0325, 0.045])
def test_a_board_seen_in_part_has_no_corners_at_the_border(target: Target, up: float) -> None:
    """A corner 2 px from the border was up to 5 px outside the image, or the whole image refused."""
    T_sb = centered(target, (0.3, -0.2, 0.1), 0.25)
    T_sb[1, 3] -= up
    found = detect(target, as_bytes(photograph(target, VGA, T_sb)))
    corners = VGA.project(pose.transform(T_sb, target.points()))
    assert np.abs(found.pixels - corners[found.ids]).max() < 0.1


@pytest.mark.parametrize("target", [*BOARDS, AprilGrid(6, 5, 0.03, 0.009), Circles(9, 7, 0.03, 0.018)], ids=repr)
@pytest.mark.parametrize("seed", range(6))
def test_a_stain_beside_a_corner_does_not_move_it(target: Target, seed: int) -> None:
    """Its edge crosses that of a square, or cuts a disc off: the largest of these errors was 10 px."""
    random = np.random.default_rng(seed)
    T_sb = centered(target, (0.35, -0.4, 0.2), 0.5)
    image = as_bytes(photograph(target, VGA, T_sb))
    corners = VGA.project(pose.transform(T_sb, target.points()))
    square_px = float(np.linalg.norm(corners[1] - corners[0]))
    for stained in random.choice(len(corners), 3, replace=False):
        middle = np.rint(16 * (corners[stained] + random.normal(0, 0.2 * square_px, 2))).astype(int).tolist()
        radius, level = 16 * random.uniform(0.1, 0.35) * square_px, random.uniform(20, 210)
        cv2.circle(image, middle, round(radius), level, -1, cv2.LINE_AA, 4)
    try:
        found = detect(target, image)
    except (errors.NothingFoundError, errors.HiddenError):
        return
    assert len(found.ids) > 0.75 * len(corners)
    assert np.abs(found.pixels - corners[found.ids]).max() < 1.5


def test_a_board_whose_outer_column_is_hidden_is_not_numbered_from_the_next_one() -> None:
    """The ends of the outermost squares on the other side were taken for corners, and all of the numbers displaced."""
    target, camera = Chessboard(9, 6, 0.03), Camera(640, 360, 460, 460, 322, 176)
    image = as_bytes(photograph(target, camera, board_pose((-0.592, -0.417, -0.212), (-0.15, -0.0893, 0.4463))))
    for down in (163, 201, 240):
        cv2.line(image, (412, down), (640, down + 84), 60, 28, cv2.LINE_AA)  # fingers
    with pytest.raises((errors.HiddenError, errors.NothingFoundError)):
        detect(target, image)


@pytest.mark.parametrize("hidden", [4, 62])
def test_discs_that_others_are_taken_for_are_not_found(hidden: int) -> None:
    """With one disc hidden, the search put others in its row and column, some 32 px from their places."""
    target = Circles(9, 7, 0.03, 0.018)
    T_sb = centered(target, (0.2, 0.3, -0.1), 0.6)
    image = as_bytes(photograph(target, VGA, T_sb))
    discs = VGA.project(pose.transform(T_sb, target.points()))
    out = discs[hidden] - discs.mean(axis=0)
    first, last = (np.rint(discs[hidden] + far * out / np.linalg.norm(out)).astype(int).tolist() for far in (0, 300))
    cv2.line(image, first, last, 115, int(0.8 * np.linalg.norm(discs[1] - discs[0])), cv2.LINE_AA)
    with pytest.raises(errors.HiddenError, match="others taken for them"):
        detect(target, image)
