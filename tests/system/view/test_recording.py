"""The page of a recording in a headless browser, and on a phone."""

import signal

import pytest

from tests.abs_service.commands.recordings.estimated_recording import write_estimated
from tests.system.view.browsing import PATIENCE_S, opened, place_of, says

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(800)]


def test_a_recording_is_played_to_its_end_stepped_back_and_played_again(tmp_path, launch, browser, port):
    server = launch("view", write_estimated(tmp_path / "x.mcap"), "--port", port)
    page, _ = opened(browser, port)
    says(page, "Tracking")
    page.get_by_role("button", name="Play", exact=True).wait_for()  # it is over, and says so
    for status in ("Object lost", "Tracking with doubts"):
        page.get_by_role("button", name="Back").click()
        says(page, status)
    page.get_by_role("tab", name="Images").click()
    says(page, "tof/depth")
    page.get_by_role("button", name="Play", exact=True).click()
    page.get_by_text("Tracking with doubts").first.wait_for(state="hidden")
    assert page.get_by_role("button", name="Reinitialise").count() == 0
    server.send_signal(signal.SIGTERM)
    assert server.wait(PATIENCE_S) == 0


def test_on_a_phone_the_panel_leaves_half_of_the_scene_and_its_controls_are_in_reach(tmp_path, launch, browser, port):
    launch("view", write_estimated(tmp_path / "x.mcap"), "--port", port)
    page, _ = opened(browser, port, viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True)
    says(page, "Tracking")
    play = page.get_by_role("button", name="Play", exact=True)
    play.wait_for()
    scene, panel = place_of(page.locator("canvas").first), place_of(page.locator(".mantine-Paper-root").first)
    assert scene["width"] == panel["width"] == 390
    assert 844 / 2 <= scene["y"] + scene["height"] <= panel["y"]  # it hides nothing of the scene
    for box in (place_of(page.locator(".abs-status").first), place_of(play)):
        assert 0 <= box["x"] <= 390 - box["width"]
        assert 844 / 2 <= box["y"] <= 844 - box["height"]
    buttons_stay_where_they_are(page, play)
    page.get_by_role("button", name="Back").tap()
    says(page, "Object lost")
    page.get_by_role("tab", name="Images").tap()
    says(page, "tof/depth")


def buttons_stay_where_they_are(page, button):
    """The status scrolls, and does not push what is below it."""
    before = place_of(button)
    page.add_style_tag(content=".abs-status { min-height: 300px }")
    assert page.locator(".abs-status").first.evaluate("one => one.offsetHeight") >= 300
    assert place_of(button) == before
