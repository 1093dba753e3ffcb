"""The region above_plane where an arm reaches in over the image's border to the object, or a wall stands behind."""

import numpy as np
import pytest

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.regions import above_plane
from tests.abs_service.tracker.detection.test_regions_on_a_table import CAMERA, HEIGHT, UP

ROWS, COLUMNS = np.mgrid[:120, :160]
BLOCK = (slice(45, 90), slice(80, 125))
INSIDE = (slice(49, 84), slice(84, 121))


def view_of(above: np.ndarray) -> DepthView:
    """A table that fills the image, with things of some height (120, 160) above it [m]."""
    lengths = (HEIGHT - above) / -(CAMERA.rays() @ UP)
    lengths += np.random.default_rng(3).normal(0, 0.001, lengths.shape)
    return DepthView.of(lengths.astype(np.float32), CAMERA)


def block() -> np.ndarray:
    """A block whose front rises from the table."""
    above = np.zeros((120, 160))
    above[BLOCK] = np.clip((90 - ROWS) * 0.008, 0, 0.05)[BLOCK]
    return above


def arm(above: np.ndarray, narrow: int = 4, upright: bool = False) -> np.ndarray:
    """An arm from the left border down to the block, half as wide at the wrist as at the border, and its fist.

    Args:
        above: heights (120, 160) of the other things [m].
        narrow: half of the width of the wrist [px].
        upright: the arm stays above the table to its end, and touches nothing.
    """
    end = 60 if upright else 84
    half = np.where(COLUMNS < 70, 10 - (10 - narrow) * COLUMNS / 70, 9)
    is_arm = (np.abs(ROWS - 60) <= half) & (end >= COLUMNS)
    slope = 0.25 - (0.10 if upright else 0.20) * COLUMNS / end
    return np.where(is_arm, slope, above)


def test_an_arm_that_holds_the_object_is_cut_off_at_its_wrist():
    selected = above_plane.Settings().build().select(view_of(arm(block())))
    assert selected[INSIDE].all()
    assert not selected[:, :62].any()
    assert not selected[:40].any()


def test_a_seed_on_the_object_leaves_the_arm_out_and_one_on_the_arm_keeps_it():
    view = view_of(arm(block()))
    on_block, on_arm = (above_plane.Settings(seed=seed).build().select(view) for seed in ((105, 60), (20, 60)))
    assert on_block[INSIDE].all()
    assert not on_block[:, :62].any()
    assert on_arm[60, 20]


def test_an_arm_that_is_larger_than_the_object_and_touches_nothing_is_not_it():
    above = block()
    above[:, :100] = above[:, 125:] = 0.0
    selected = above_plane.Settings().build().select(view_of(arm(above, narrow=10, upright=True)))
    assert selected[60:80, 104:120].all()
    assert not selected[:, :95].any()


def test_an_arm_alone_is_what_is_above_the_table():
    assert above_plane.Settings().build().select(view_of(arm(np.zeros((120, 160)), upright=True)))[60, 30]


@pytest.mark.parametrize("left", [0, 30])
def test_an_object_that_rests_where_the_image_cuts_it_off_is_kept(left):
    above = np.zeros((120, 160))
    above[40:90, left : left + 60] = np.clip((90 - ROWS) * 0.008, 0, 0.05)[40:90, left : left + 60]
    assert above_plane.Settings().build().select(view_of(above))[44:84, max(left + 4, 6) : left + 56].all()


def test_a_wall_behind_the_end_of_the_table_is_no_thing_on_it():
    distance = view_of(block()).distance.copy()
    distance[:35] = distance[35].max() + 0.02  # larger than the block
    selected = above_plane.Settings().build().select(DepthView.of(distance, CAMERA))
    assert selected[INSIDE].all()
    assert not selected[:35].any()
