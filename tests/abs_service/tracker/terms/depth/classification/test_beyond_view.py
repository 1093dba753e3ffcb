"""Fields of view that end before the image, and objects before nothing, which do not end a field of view."""

import numpy as np
import pytest

from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.beyond_view import BeyondView, beyond

HEIGHT, WIDTH = 120, 160
ROWS, COLUMNS = np.indices((HEIGHT, WIDTH))
NOTHING = np.zeros((HEIGHT, WIDTH), np.bool_)
#: The stripe at the edge in which returns may be missing [px].
STRIPE = 2


def box(top, bottom, left, right):
    mask = np.zeros((HEIGHT, WIDTH), np.bool_)
    mask[top:bottom, left:right] = True
    return mask


def disc(radius):
    return np.hypot(ROWS - 59.5, COLUMNS - 79.5) < radius


HEXAGON = np.minimum(COLUMNS, WIDTH - 1 - COLUMNS) / 40 + np.minimum(ROWS, HEIGHT - 1 - ROWS) / 60 >= 1
OBJECT = box(30, 80, 60, 110)


@pytest.mark.parametrize("view", [
    box(0, 120, 0, 158),
    box(3, 116, 10, 160),
    box(0, 120, 20, 140),
    HEXAGON,
    disc(64),
    HEXAGON & box(0, 120, 6, 154),
], ids=["columns", "margins", "registered", "hexagon", "circle", "cut hexagon"])  # fmt: skip
def test_what_is_around_a_field_of_view_is_beyond_it(view):
    found = beyond(~view, OBJECT)
    assert found[~view].all()
    inside = view & ~found
    grown = NOTHING.copy()
    for down in range(-STRIPE, STRIPE + 1):
        for right in range(-STRIPE, STRIPE + 1):
            grown |= np.roll(found & ~view, (down, right), axis=(0, 1))
    assert inside[view & ~grown].all(), "more than the stripe at the edge is lost"


@pytest.mark.parametrize("turns", range(4))
def test_columns_along_one_side_are_blind_whatever_ends_along_another(turns):
    """The lower half is a table that comes too near to be measured before the image ends."""
    view = box(0, 120, 0, 154) & (ROWS < 84 + COLUMNS // 8)
    table = view & (ROWS >= 50)
    found = beyond(np.rot90(~view, turns), np.rot90(table, turns))
    assert np.rot90(found, -turns)[:, 154:].all()
    assert not np.rot90(found, -turns)[:, :152].any()


def test_an_image_that_is_full_ends_nowhere():
    assert not beyond(NOTHING, OBJECT).any()
    assert not beyond(~NOTHING, OBJECT).any()


@pytest.mark.parametrize(("returns", "silhouette"), [
    (box(10, 110, 10, 150), box(13, 107, 13, 147)),  # a sheet, from which its mesh ends a little inside
    (box(10, 110, 10, 150), box(17, 103, 17, 143)),  # a coarser mesh ends farther inside
    (box(10, 110, 10, 150) | box(60, 70, 0, 160), box(13, 107, 13, 147)),  # held by two arms
    (box(20, 100, 30, 120), OBJECT),  # on a small table
    (disc(59), disc(57)),
], ids=["sheet", "coarse mesh", "held", "small table", "body"])  # fmt: skip
def test_what_lies_before_nothing_is_no_field_of_view(returns, silhouette):
    assert not beyond(~returns, silhouette).any()


def test_a_background_without_return_at_one_side_is_none():
    """Its edge in the image is not that of a convex hull, unless something reaches as far all along it."""
    returns = box(0, 120, 0, 110) | box(50, 60, 110, 160)
    assert not beyond(~returns, OBJECT).any()


def test_dropouts_and_strays_change_nothing():
    generator = np.random.default_rng(1)
    returns = HEXAGON & (generator.random((HEIGHT, WIDTH)) < 0.7)
    returns[2, 3] = returns[117, 155] = True
    found = beyond(~returns, OBJECT)
    assert np.count_nonzero(found ^ beyond(~HEXAGON, OBJECT)) < 100


def test_the_first_image_decides_and_only_missing_returns_count():
    view = BeyondView()
    np.testing.assert_array_equal(view.observe(~HEXAGON, OBJECT, WHOLE), ~HEXAGON)
    part = slice(0, 30), slice(0, 40)
    hole = np.ones((30, 40), np.bool_)
    found = view.observe(hole, OBJECT[part], part)
    assert found[0, 0]
    assert not found[29, 39]
    assert not view.observe(~hole, OBJECT[part], part).any()
