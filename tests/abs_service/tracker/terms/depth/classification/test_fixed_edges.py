"""Edges that stay where they are in the image while the rest of the outline changes, and edges that do not stay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import abs_service as a
from abs_service.tracker.detection.dropouts import dropouts
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.fixed_edges import LATER_IMAGES, FixedEdges, compare_places
from calib.camera import Camera

HEIGHT, WIDTH = 120, 160
ROWS, COLUMNS = np.indices((HEIGHT, WIDTH))
#: Numbers of the images that are compared with the first one.
LATER = range(1, LATER_IMAGES + 1)
COLUMNS_CUT = (COLUMNS >= 6) & (COLUMNS < WIDTH - 4)
HEXAGON = np.minimum(COLUMNS, WIDTH - 1 - COLUMNS) / 40 + np.minimum(ROWS, HEIGHT - 1 - ROWS) / 60 >= 1


def board(by: float = 0.0, left: float = -100.0, right: float = 300.0, slope: float = 0.0) -> np.ndarray:
    """Pixels of a board between two lines, moved down [px]; its ends, in columns, lean by a slope."""
    along = COLUMNS + slope * (ROWS - 60)
    return (np.abs(ROWS - 45 - by) < 25) & (along > left) & (along < right)


def found(images: list[np.ndarray]) -> np.ndarray:
    """Pixels beyond fixed edges in the last of some images of returns."""
    edges, beyond = FixedEdges(), np.zeros((HEIGHT, WIDTH), np.bool_)
    for returns in images:
        beyond = edges.observe(~returns, ~returns & ~dropouts(~returns), returns, WHOLE)
    return beyond


@pytest.mark.parametrize("view", [COLUMNS_CUT, HEXAGON], ids=["columns", "hexagon"])
@pytest.mark.parametrize("dropped", [0.0, 0.01])
def test_the_ends_of_a_board_that_moves_across_itself_are_those_of_the_view(view, dropped):
    generator = np.random.default_rng(0)
    images = [board(0.5 * k) & view & (generator.random(view.shape) >= dropped) for k in (0, *LATER)]
    beyond = found(images)
    beside = ~view & (np.abs(ROWS - 45) < 20) & (np.minimum(COLUMNS, WIDTH - 1 - COLUMNS) < 0.15 * WIDTH)
    assert np.mean(beyond[beside]) > 0.95
    assert not np.any(beyond & view & (images[-1] == board(0.5 * LATER_IMAGES) & view))


def test_it_takes_some_images():
    assert not found([board(0.5 * k) & COLUMNS_CUT for k in (0, *LATER)][:-1]).any()


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_ends_that_move_are_those_of_the_board(slope: float):
    """Half a pixel in each image, along itself."""
    assert not found([board(0.0, 8 + 0.5 * k, 150 + 0.5 * k, slope) for k in (0, *LATER)]).any()


def test_nothing_is_told_of_what_stands_still():
    assert not found([board(0.0, 8, 150)] * (LATER_IMAGES + 1)).any()


def test_ends_that_noise_frays_are_those_of_the_board():
    """In every image, each pixel along its outline is missing or not."""
    generator = np.random.default_rng(0)
    inner = (np.abs(ROWS - 45) < 24) & (COLUMNS > 9) & (COLUMNS < 149)
    images = [inner | (board(0.0, 8, 150) & (generator.random(inner.shape) < 0.5)) for _ in (0, *LATER)]
    assert not found(images).any()


def test_a_fixed_edge_far_from_the_sides_of_the_image_is_none_of_the_view():
    """A board that moves across itself, along its own ends."""
    assert not found([board(0.5 * k, 40, 120) for k in (0, *LATER)]).any()


def test_an_edge_is_forgotten_when_something_returns_beyond_it():
    cut = [board(0.5 * k) & COLUMNS_CUT for k in (0, *LATER)]
    arm = (np.abs(ROWS - 100) < 4) & (COLUMNS < 5)
    beyond = found([*cut, cut[-1] | arm])
    assert not beyond[:, :6].any()
    assert beyond[30:60, WIDTH - 4 :].all()
    beyond = found([cut[0] | arm, *cut[1:]])
    assert not beyond[:, :6].any()


def test_an_outline_that_comes_to_the_end_of_the_view_is_found_there_too():
    moving = [board(0.5 * k, 40 - 3 * k, 120) & COLUMNS_CUT for k in range(3 * (LATER_IMAGES + 1) + 1)]
    assert not found(moving[: 2 * (LATER_IMAGES + 1)]).any()
    assert found(moving + [board(8 + 0.5 * k, -5, 120) & COLUMNS_CUT for k in range(2 * (LATER_IMAGES + 1))]).any()


CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)


@pytest.mark.parametrize(("half_length_m", "expected"), [(1.0, "DEGRADED"), (0.35, "TRACKING")])
def test_a_board_alone_before_nothing_is_not_held_by_blind_columns(half_length_m: float, expected: str):
    """It is turned by 10° in the image and 14 cm wide; noise takes every other pixel along its edges.

    The camera sees nothing in its first and last 6 columns, beyond which the longer board goes on.
    """
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    along, across = np.cos(0.17) * x + np.sin(0.17) * y, np.cos(0.17) * y - np.sin(0.17) * x
    on, inner = ((np.abs(along) < half_length_m - by) & (np.abs(across) < 0.07 - by) for by in (0.0, 0.0025))
    generator, tracker = np.random.default_rng(0), a.Tracker(CAMERA, a.Nurbs())
    status = []
    for k in range(LATER_IMAGES + 3):
        seen = inner | (on & (generator.random(on.shape) < 0.5))
        seen[:, :6] = seen[:, -6:] = False
        distance = np.where(seen, 0.7 + 0.001 * generator.standard_normal(on.shape), np.nan)
        status.append(tracker.track(distance, time_s=k / 30, mask=seen))
    assert status[-1].status == expected
    assert ("nothing holds the surface along itself" in "".join(status[-1].reasons)) == (expected == "DEGRADED")


@pytest.mark.parametrize(("half_height_m", "frayed_m"), [(0.07, 0.0), (0.03, 0.001)])
@pytest.mark.parametrize(("half_length_m", "expected"), [(1.0, "DEGRADED"), (0.2, "TRACKING")])
def test_an_outline_that_has_not_changed_does_not_hold_a_board(
    half_height_m: float, frayed_m: float, half_length_m: float, expected: str
):
    """It rests for eight images and is then drawn along itself by 6 mm a frame, beneath the last columns.

    The end of a view that is shorter than a fixed edge, or all of whose outline stands still, is none that is known.
    """
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    generator, tracker, status = np.random.default_rng(3), a.Tracker(CAMERA, a.Nurbs()), []
    for k in range(14):
        noise, frayed = generator.standard_normal((2, *x.shape))
        on = (np.abs(x - 0.006 * max(0, k - 8) + frayed_m * frayed) < half_length_m) & (
            np.abs(y) < half_height_m + frayed_m * frayed
        )
        on[:, :7] = on[:, -7:] = False
        distance = np.where(on, 0.7 + 0.1 * x**2 + 0.0015 * noise, np.nan)
        status.append(tracker.track(distance, time_s=k / 30, mask=on).status)
    assert status == [expected] * 14


@given(st.integers(0, 2**32 - 1), st.integers(0, 30))
def test_places_stay_fixed_while_returns_end_there(seed: int, count: int):
    generator, (top, left) = np.random.default_rng(seed), (3, 5)
    missing = generator.random((6, 8)) < 0.5
    last, beside = generator.integers(0, 16, (2, count, 2))
    is_fixed = generator.random(count) < 0.8
    whole = np.full((20, 20), -1)
    whole[top : top + 6, left : left + 8] = missing
    expected = is_fixed & (whole[tuple(last.T)] == 0) & (whole[tuple(beside.T)] == 1)
    compare_places(last, beside, missing, (top, left), is_fixed)
    np.testing.assert_array_equal(is_fixed, expected)
