"""Gestures on the screen become pixels of the depth image, seen from any side."""

import numpy as np
import pytest

from abs_service.display.page.acting import choosing
from abs_service.display.page.acting.choosing import Choosing, Measured
from abs_service.display.page.acting.gestures import Eye
from abs_service.tracker.detection.segments.within import filled
from abs_service.wire.commands import Choice
from calib.camera import Camera

T_RS = np.array([[0.0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, T_rs=T_RS)
#: A board of 20 × 12 pixels one metre away, before a wall at two; no return in a corner.
DISTANCE = np.full((48, 64), 2.0)
DISTANCE[20:32, 24:44] = 1.0
DISTANCE[:5, :5] = np.nan
MEASURED = Measured(DISTANCE, CAMERA)
BOARD = np.zeros((48, 64), bool)
BOARD[20:32, 24:44] = True


def eye(aside: float) -> Eye:
    """Half a metre behind the sensor and `aside` of it [m], with its axes."""
    T_re = T_RS.copy()
    T_re[:3, 3] += T_RS[:3, :3] @ (aside, 0.0, -0.5)
    return Eye(T_re, 1.2, 1.5)


def points() -> np.ndarray:
    return CAMERA.unproject(DISTANCE.astype(np.float32))


def around(seen_from: Eye) -> np.ndarray:
    """Corners of a box on the screen, a little larger than the board."""
    place = seen_from.project(points()[BOARD])
    low, high = place.min(axis=0) - 0.003, place.max(axis=0) + 0.003
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])])


def test_the_middle_of_the_view_is_the_middle_of_the_screen_and_up_is_small():
    seen_from = eye(0.0)
    ahead, above, behind = (T_RS[:3, 3] + T_RS[:3, :3] @ offset for offset in ((0, 0, 1), (0, -0.3, 1), (0, 0, -1)))
    place = seen_from.project(np.array([ahead, above, behind]))
    np.testing.assert_allclose(place[0], [0.75, 0.5])
    assert place[1, 1] < 0.5
    assert np.isnan(place[2]).all()
    edge = np.array([0.0, 1.5 * np.tan(0.6), 1.5])  # half the field of view below, as seen from behind
    np.testing.assert_allclose(seen_from.project((T_RS[:3, 3] + T_RS[:3, :3] @ (edge - (0, 0, 0.5)))[None])[0, 1], 1.0)


@pytest.mark.parametrize("aside", [0.0, 0.4])
def test_a_box_holds_all_pixels_of_what_is_drawn_around(aside):
    choice = choosing.in_box(MEASURED, eye(aside), around(eye(aside)))
    assert choice is not None
    assert len(choice.polygon) == 4
    assert filled(choice.polygon, DISTANCE.shape)[BOARD].all()
    assert np.count_nonzero(filled(choice.polygon, DISTANCE.shape)) < 3 * np.count_nonzero(BOARD)


@pytest.mark.parametrize("aside", [0.0, 0.4])
def test_a_lasso_holds_the_pixels_whose_points_are_in_it(aside):
    seen_from, drawn = eye(aside), around(eye(aside))
    choice = choosing.in_lasso(MEASURED, seen_from, drawn)
    assert choice is not None
    assert filled(choice.polygon, DISTANCE.shape)[BOARD].mean() > 0.9  # within a pixel


def test_a_lasso_with_a_dent_leaves_out_the_dent():
    left, top, right, bottom = 24, 20, 43, 31
    corners = [(left, top), (right, top), (right, bottom), ((left + right) / 2, (top + bottom) / 2), (left, bottom)]
    seen_from = Eye(T_RS, 1.2, 1.5)
    rays = np.array([((u - 31.5) / 60, (v - 23.5) / 60, 1.0) for u, v in corners])
    choice = choosing.in_lasso(MEASURED, seen_from, seen_from.project(T_RS[:3, 3] + rays @ T_RS[:3, :3].T))
    assert choice is not None
    inside = filled(choice.polygon, DISTANCE.shape)
    assert not inside[30, 33]
    assert inside[22, 33]
    assert not inside[~BOARD].any()


def test_the_polygon_of_several_patches_is_their_hull_and_specks_do_not_count():
    inside = np.zeros((48, 64), bool)
    assert choosing.polygon(inside) == ()
    inside[2, 2] = True
    assert choosing.polygon(inside) == ()
    inside[10:20, 10:20] = inside[30:40, 40:50] = True
    hull = filled(choosing.polygon(inside), inside.shape)
    assert hull[25, 30]
    assert not hull[2, 2]


def test_a_polygon_of_any_shape_has_few_enough_corners():
    rows, columns = np.mgrid[:1000, :1000]
    angle = np.arctan2(rows - 500, columns - 500)
    star = np.hypot(rows - 500, columns - 500) < 300 + 150 * np.sin(400 * angle)
    assert 3 <= len(choosing.polygon(star)) <= choosing.MAX_CORNERS


class Pointer:
    """Gestures that are made when the page says how."""

    def __init__(self, ray=None, drawn=None):
        self._ray, self._drawn = ray, drawn
        self._gesture = None

    def click(self, call):
        self._gesture = lambda: call(self._ray)

    def box(self, call):
        self._gesture = lambda: call(eye(0.0), self._drawn)

    def lasso(self, call, restarted):
        self._gesture = lambda: (restarted(), call(eye(0.0), self._drawn))

    def make(self):
        gesture, self._gesture = self._gesture, None
        if gesture is not None:
            gesture()


def page(pointer, measured: Measured | None = MEASURED):
    """The page's part with what it says and asks."""
    said, asked = [], []

    def say(text):
        said.append(text)
        pointer.make()

    return Choosing(pointer, {"sheet": measured}.get, say, lambda *one: asked.append(one)), said, asked


def test_a_click_chooses_the_pixel_under_it():
    target = points()[25, 30]
    ray = eye(0.1).T_re[:3, 3], target - eye(0.1).T_re[:3, 3]
    choosing_page, said, asked = page(Pointer((ray[0], ray[1] / np.linalg.norm(ray[1]))))
    choosing_page.by_click("sheet")
    assert said == ["Click the object among the measured points."]
    assert asked == [("sheet", Choice(seed=(30, 25)))]


def test_boxes_and_lassos_are_asked_for_and_nothing_is_told():
    choosing_page, said, asked = page(Pointer(drawn=around(eye(0.0))))
    choosing_page.by_box("sheet")
    choosing_page.by_lasso("sheet")
    assert [len(choice.polygon) >= 4 for _, choice in asked] == [True, True]
    assert "the lasso begins anew" in said[-1]
    empty = np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 0.01]])
    for measured, drawn in ((MEASURED, empty), (None, around(eye(0.0)))):
        choosing_page, said, asked = page(Pointer(drawn=drawn), measured)
        choosing_page.by_box("sheet")
        choosing_page.by_lasso("sheet")
        assert asked == []
        assert "no measured point" in said[-1]
