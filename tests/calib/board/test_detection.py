"""Corners of boards in rendered images, against where they truly are, and every reason why an image is refused."""

import cv2
import numpy as np
import pytest

from calib import pose
from calib.board.april_grid import AprilGrid
from calib.board.corners import errors
from calib.board.corners.detection import detect
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target
from evaluation.scenes.boards.board_images import TOF, VGA, as_bytes, centered, photograph, photograph_by_fisheye

CHESSBOARD = Chessboard(9, 6, 0.03)
CHARUCO = Charuco(10, 7, 0.03, 0.0225, "4x4_100")
TARGETS = [
    CHESSBOARD,
    Chessboard(6, 9, 0.03),
    Chessboard(7, 7, 0.03),
    CHARUCO,
    Charuco(8, 8, 0.03, 0.022, "5x5_250"),
    Charuco(8, 6, 0.03, 0.022, "4x4_50", legacy=True),
    Circles(7, 5, 0.04, 0.02),
    Circles(6, 6, 0.04, 0.02),
    AsymmetricCircles(4, 9, 0.025, 0.02),
    Charuco(10, 7, 0.03, 0.0225, "apriltag_36h11"),
]
TILTED = (0.35, -0.4, 0.2)


def truth(target: Target, T_sb: pose.Pose, camera=VGA):
    return camera.project(pose.transform(T_sb, target.points()))


@pytest.mark.parametrize("target", TARGETS, ids=repr)
@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), TILTED])
def test_every_kind_is_found_in_order_and_to_a_tenth_of_a_pixel(target: Target, rotation) -> None:
    T_sb = centered(target, rotation, 0.6)
    found = detect(target, as_bytes(photograph(target, VGA, T_sb)))
    assert len(found.ids) == len(target.points())
    error = found.pixels - truth(target, T_sb)[found.ids]
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.abs(error).max() < 0.2


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), TILTED, (0.6, 0.3, 1.0), (0.0, 0.0, np.pi)])
def test_an_april_grid_is_found_in_part_and_where_it_is(rotation) -> None:
    grid = AprilGrid(6, 5, 0.03, 0.009)
    T_sb = centered(grid, rotation, 0.5)
    found = detect(grid, as_bytes(photograph(grid, VGA, T_sb)))
    assert len(found.ids) > 0.75 * len(grid.points())
    error = found.pixels - truth(grid, T_sb)[found.ids]
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.abs(error).max() < 0.2
    assert 1.0 < found.edge_px < 2.5


def test_corners_of_tags_whose_black_has_spread_are_found() -> None:
    grid = AprilGrid(6, 6, 0.03, 0.009)
    image = photograph(grid, VGA, centered(grid, (0.2, 0.0, np.pi / 4), 0.42))
    spread = cv2.GaussianBlur(cv2.erode(as_bytes(image), np.ones((2, 2), np.uint8)), (0, 0), 0.5)
    assert len(detect(grid, spread).ids) > 0.95 * len(grid.points())  # of 144, it was 65


def test_tag_0_of_an_april_grid_is_in_its_lower_left_corner_as_in_kalibr() -> None:
    grid = AprilGrid(6, 5, 0.03, 0.009)
    image = as_bytes(photograph(grid, VGA, centered(grid, (0, 0, 0), 0.5)))
    code, first = 0xD5D628584, grid.points()[grid.ids_of_tag(0)].mean(axis=0)
    assert first[0] == pytest.approx(0.015)
    assert first[1] == pytest.approx(grid.points()[:, 1].max() - 0.015)
    # Kalibr's code of tag 0, most significant bit in the upper left corner, white where it is set.
    row, column = np.divmod(np.arange(36), 6)
    cells = first + 0.003 * np.stack([column - 2.5, row - 2.5, np.zeros(36)], axis=1)
    u, v = np.rint(VGA.project(pose.transform(centered(grid, (0, 0, 0), 0.5), cells))).astype(int).T
    assert [bool(code >> (35 - bit) & 1) for bit in range(36)] == (image[v, u] > 115).tolist()


@pytest.mark.parametrize("target", [CHESSBOARD, Chessboard(6, 9, 0.03), CHARUCO, AsymmetricCircles(4, 9, 0.025, 0.02)])
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_board_with_one_way_up_is_found_in_order_however_it_is_turned(target: Target, quarters: int) -> None:
    T_sb = centered(target, (0, 0, quarters * np.pi / 2), 0.75)
    found = detect(target, as_bytes(photograph(target, VGA, T_sb)))
    assert np.abs(found.pixels - truth(target, T_sb)[found.ids]).max() < 0.2


def test_a_board_that_looks_the_same_when_turned_points_to_the_right() -> None:
    board = Chessboard(8, 6, 0.03)
    T_sb = centered(board, (0, 0, np.pi), 0.6)
    found = detect(board, as_bytes(photograph(board, VGA, T_sb)))
    assert found.pixels[0, 0] < found.pixels[7, 0]


@pytest.mark.parametrize(
    "make",
    [
        as_bytes,
        lambda image: np.repeat(as_bytes(image)[..., None], 3, axis=2),
        lambda image: np.clip(40 * image, 0, 65535).astype(np.uint16),
        lambda image: np.where(image > 25, 1e-3 * image, np.nan).astype(np.float32),
    ],
)
def test_images_of_any_type_show_the_same_corners(make) -> None:
    T_sb = centered(CHESSBOARD, TILTED, 0.6)
    found = detect(CHESSBOARD, make(photograph(CHESSBOARD, VGA, T_sb)))
    assert np.abs(found.pixels - truth(CHESSBOARD, T_sb)).max() < 0.3


@pytest.mark.parametrize("target", [CHESSBOARD, Circles(7, 5, 0.05, 0.03)])
def test_the_small_image_of_a_time_of_flight_camera_is_enough(target: Target) -> None:
    T_sb = centered(target, (0.2, -0.3, 0.1), 0.7)
    found = detect(target, np.clip(20 * photograph(target, TOF, T_sb), 0, 65535).astype(np.uint16))
    error = found.pixels - truth(target, T_sb, TOF)
    assert np.sqrt(np.mean(error**2)) < 0.06


def test_a_part_of_a_charuco_board_is_enough() -> None:
    T_sb = centered(CHARUCO, TILTED, 0.5)
    T_sb[0, 3] += 0.2
    found = detect(CHARUCO, as_bytes(photograph(CHARUCO, VGA, T_sb)))
    assert 10 < len(found.ids) < len(CHARUCO.points())
    assert np.abs(found.pixels - truth(CHARUCO, T_sb)[found.ids]).max() < 0.3


@pytest.mark.parametrize("noise", [2.0, 8.0])
def test_the_deviation_is_estimated_from_one_image(noise: float) -> None:
    errors, estimates = [], []
    for seed in range(2):
        T_sb = centered(CHESSBOARD, (0.3, 0.1 * seed - 0.3, 0.1), 0.6)
        found = detect(CHESSBOARD, as_bytes(photograph(CHESSBOARD, VGA, T_sb, noise=noise, seed=seed)))
        errors.append(found.pixels - truth(CHESSBOARD, T_sb))
        estimates.append(found.sigma_px)
    true = float(np.sqrt(np.mean(np.square(errors))))
    assert 0.6 * true < np.mean(estimates) < 1.6 * true + 0.01


def test_the_centre_of_a_slanted_disc_is_where_the_disc_is_and_not_its_image() -> None:
    target = Circles(5, 4, 0.08, 0.06)
    T_sb = centered(target, (0.0, 0.9, 0.0), 0.6)
    found = detect(target, as_bytes(photograph(target, VGA, T_sb, noise=0.5)))
    assert np.abs((found.pixels - truth(target, T_sb)).mean(axis=0)).max() < 0.05


def test_a_view_has_the_points_of_the_board_and_the_estimated_deviation() -> None:
    found = detect(CHARUCO, as_bytes(photograph(CHARUCO, VGA, centered(CHARUCO, TILTED, 0.5))))
    view = found.view(CHARUCO, "color", 3, 1.5)
    assert (view.sensor, view.shot, view.t_s, view.sigma_px) == ("color", 3, 1.5, found.sigma_px)
    assert np.array_equal(view.points_b, CHARUCO.points()[found.ids])


def refused(target: Target, image, **settings) -> tuple[type[Exception], str]:
    with pytest.raises(errors.BoardError) as caught:
        detect(target, image, **settings)
    return caught.type, str(caught.value)


@pytest.mark.parametrize("target", [CHESSBOARD, CHARUCO, Circles(7, 5, 0.04, 0.02)])
def test_an_image_without_a_board_is_refused(target: Target) -> None:
    noise = np.random.default_rng(1).standard_normal((480, 640)).astype(np.float32)
    image = as_bytes(128 + 500 * cv2.GaussianBlur(noise, (0, 0), 5))
    reason, message = refused(target, image)
    assert reason is errors.NothingFoundError
    assert message.startswith("no board found")


def test_a_mirrored_board_is_refused() -> None:
    image = as_bytes(photograph(CHARUCO, VGA, centered(CHARUCO, TILTED, 0.5)))[:, ::-1]
    reason, message = refused(CHARUCO, image)
    assert reason is errors.MirroredBoardError
    assert "mirror" in message
    # A point or two may be chance, as markers of large dictionaries look like others in a mirror.
    covered = np.full_like(image, 115)
    covered[180:300, 260:380] = image[180:300, 260:380]
    assert refused(CHARUCO, covered)[0] is errors.NothingFoundError


@pytest.mark.parametrize("top", [1023, 4095, 65535])
def test_a_saturated_amplitude_is_refused(top: int) -> None:
    image = photograph(CHESSBOARD, VGA, centered(CHESSBOARD, TILTED, 0.6), black=0.2, white=1.2, noise=0.01)
    amplitude = np.clip(top * image, 0, top).astype(np.uint16)
    reason, message = refused(CHESSBOARD, amplitude, maximum_saturated=0.1)
    assert reason is errors.SaturatedError
    assert "shorter exposure" in message
    assert len(detect(CHESSBOARD, amplitude).ids) == 54, "corners themselves survive that white is saturated"


def test_an_image_that_is_all_white_says_so() -> None:
    assert refused(CHESSBOARD, np.full((480, 640), 255, np.uint8))[0] is errors.SaturatedError


@pytest.mark.parametrize("target", [CHESSBOARD, Circles(7, 5, 0.04, 0.02)])
def test_a_board_that_is_too_far_away_is_refused(target: Target) -> None:
    image = as_bytes(photograph(target, VGA, centered(target, (0, 0, 0), 550 * target.points()[1, 0] / 4.5)))
    reason, message = refused(target, image)
    assert reason is errors.TooSmallError
    assert "closer" in message


@pytest.mark.parametrize("target", [CHESSBOARD])
def test_a_board_that_the_image_cuts_off_is_refused(target: Target) -> None:
    T_sb = centered(target, (0.1, 0.1, 0), 0.5)
    T_sb[0, 3] += 0.2
    reason, message = refused(target, as_bytes(photograph(target, VGA, T_sb)))
    assert reason is errors.CutOffError
    assert "border" in message


@pytest.mark.parametrize("target", [CHESSBOARD, Circles(7, 5, 0.04, 0.02)])
def test_a_board_that_moved_during_the_exposure_is_refused(target: Target) -> None:
    sharp = photograph(target, VGA, centered(target, (0.2, 0.1, 0), 0.6), noise=1.0)
    reason, message = refused(target, cv2.blur(as_bytes(sharp), (8, 1)))
    assert reason is errors.BlurredError
    assert "still" in message


@pytest.mark.parametrize("target", [CHESSBOARD, Circles(7, 5, 0.04, 0.02)])
@pytest.mark.parametrize("noise", [1, 6])
def test_points_of_a_board_out_of_focus_stay_in_place(target: Target, noise: int) -> None:
    T_sb = centered(target, (0.2, 0.1, 0), 0.6)
    found = detect(target, as_bytes(photograph(target, VGA, T_sb, noise=noise, blur=(2.5, 2.5))))
    assert found.edge_px > 0.18 * found.spacing_px
    assert np.sqrt(np.mean((found.pixels - truth(target, T_sb)[found.ids]) ** 2)) < 0.08


@pytest.mark.parametrize(("target", "noise"), [(CHESSBOARD, 1), (CHESSBOARD, 6), (Circles(7, 5, 0.04, 0.02), 1)])
def test_a_board_far_out_of_focus_is_refused_with_noise_too(target: Target, noise: int) -> None:
    image = photograph(target, VGA, centered(target, (0.2, 0.1, 0), 0.6), noise=noise, blur=(5, 5))
    reason, message = refused(target, as_bytes(image))
    assert reason is errors.BlurredError
    assert "focus" in message


def test_a_fisheye_that_bends_the_board_does_not_make_it_blurred() -> None:
    T_sb = centered(CHESSBOARD, (0, 0, 0), 0.12)
    image, pixels = photograph_by_fisheye(CHESSBOARD, T_sb)
    found = detect(CHESSBOARD, as_bytes(image))
    assert 1.5 < found.edge_px < 3.0
    assert np.abs(found.pixels - pixels).max() < 0.2
    assert refused(CHESSBOARD, as_bytes(photograph_by_fisheye(CHESSBOARD, T_sb, blur=6.0)[0]))[0] is errors.BlurredError


def test_a_board_bent_so_much_that_one_search_misses_it_is_found_by_the_other() -> None:
    T_sb = centered(CHESSBOARD, (-0.5, 0.6, 0.1), 0.18)
    T_sb[1, 3] += 0.1
    image, pixels = photograph_by_fisheye(CHESSBOARD, T_sb)
    flags = cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    assert not cv2.findChessboardCornersSB(as_bytes(image), CHESSBOARD.grid, flags=flags)[0]
    found = detect(CHESSBOARD, as_bytes(image))
    assert len(found.ids) == 53, "one was guessed, 6 px beside its place"
    assert np.abs(found.pixels - pixels[found.ids]).max() < 0.2
