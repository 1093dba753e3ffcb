"""Gestures in the scene of the page: boxes, lassos, and clicks at vertices."""

import time

import cv2
import numpy as np
import pytest

from tests.system.running import wait_until
from tests.system.view.browsing import PATIENCE_S, at, chosen, opened, picture_of, says

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(800)]


def _draw_box(page):
    page.mouse.move(*at(page, -0.45, -0.2))
    page.mouse.down()
    page.mouse.move(*at(page, 0.1, 0.1), steps=4)
    page.mouse.move(*at(page, 0.45, 0.5), steps=4)
    page.mouse.up()


def _draw_lasso(page):
    for corner in ((-0.45, -0.2), (0.45, -0.2), (0.45, 0.5), (-0.45, 0.5), (-0.45, -0.2)):
        page.mouse.click(*at(page, *corner))
        time.sleep(0.5)


def test_a_box_and_a_lasso_choose_the_object(run, rig_file, launch, browser, port):
    _, listener = run
    launch("view", rig_file, "--port", port)
    page, _ = opened(browser, port)
    says(page, "Tracking")
    for button, hint, draw in (
        ("Draw a box", "press in one corner", _draw_box),
        ("Draw a lasso", "corner by corner", _draw_lasso),
    ):
        chosen(page, listener, button, hint, lambda draw=draw: draw(page))
        says(page, "polygon = [[")


def test_a_page_that_only_shows_has_no_buttons_that_act_and_follows_vertices(run, rig_file, launch, browser, port):
    launch("view", rig_file, "--port", port, "--view-only")
    page, _ = opened(browser, port)
    says(page, "Tracking")
    for name in ("Reinitialise", "Choose the object", "Start recording", "Stop recording", "Read the controls"):
        assert page.get_by_role("button", name=name).count() == 0
    assert page.get_by_role("tab", name="Devices").count() == 0
    page.get_by_role("button", name="Follow a vertex").click()
    says(page, "Click a vertex")
    assert trail_pixels(page) == 0
    page.mouse.click(*at(page, 0, 0))
    wait_until(lambda: trail_pixels(page) > 0, PATIENCE_S, "a trail")
    page.get_by_role("button", name="Remove the trails").click()
    wait_until(lambda: trail_pixels(page) == 0, PATIENCE_S, "a scene without trails")


def trail_pixels(page) -> int:
    """Pixels of the scene that are pink, as trails are and nothing else is."""
    decoded = np.asarray(cv2.imdecode(np.frombuffer(picture_of(page), np.uint8), cv2.IMREAD_COLOR))
    blue, green, red = np.moveaxis(decoded, 2, 0)
    return int(np.count_nonzero((red > 180) & (green < 150) & (blue > 120)))
