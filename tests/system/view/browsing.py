"""A page in a browser, as tests use it."""

import time

import pytest

from tests.system.running import wait_until

pytest.importorskip("viser")
sync_api = pytest.importorskip("playwright.sync_api")

PATIENCE_S = 120  # a browser that renders in software, beside a rig


def opened(browser, port, **screen):
    """The page, once it says something, and how long that took [s]."""
    small = {"viewport": {"width": 800, "height": 900}}  # as high as the panel; every pixel is rendered in software
    page = browser.new_page(**(screen or small))
    page.set_default_timeout(1e3 * PATIENCE_S)
    begin_s = time.monotonic()
    while True:
        try:
            page.goto(f"http://127.0.0.1:{port}")
            break
        except sync_api.Error:
            assert time.monotonic() < begin_s + PATIENCE_S
            time.sleep(0.2)  # until the server listens
    page.wait_for_selector(".abs-status")
    return page, time.monotonic() - begin_s


def says(page, text):
    """Waits until the status or an answer holds a text."""
    page.get_by_text(text).first.wait_for()


def place_of(element) -> dict[str, float]:
    """Place of an element, which has none while the page draws it anew."""
    return wait_until(element.bounding_box, PATIENCE_S, "a place of the element")


def picture_of(page) -> bytes:
    return page.locator("canvas").first.screenshot()


def chosen_by_a_click(page, listener) -> int:
    """Version of the mesh that is made after a click in the middle of the scene, at which the first view is aimed."""
    return chosen(page, listener, "Choose the object", "Click the object", lambda: page.mouse.click(*at(page, 0, 0)))


def chosen(page, listener, button, hint, gesture) -> int:
    """Version of the mesh that is made after a gesture in the scene."""
    version = listener.states()[-1][1].mesh_version
    page.get_by_role("button", name=button).click()
    says(page, hint)
    gesture()
    try:
        wait_until(lambda: listener.states()[-1][1].mesh_version > version, PATIENCE_S, "a mesh of what was chosen")
    except AssertionError as error:
        error.add_note(f"the page says: {page.inner_text('body')}")
        raise
    says(page, "To keep this choice")
    return listener.states()[-1][1].mesh_version


def at(page, right, down):
    """A place in the scene, from its middle, in widths of the scene; a warning of the browser's covers the top."""
    box = place_of(page.locator("canvas").first)
    return box["x"] + (0.5 + right) * box["width"], box["y"] + box["height"] / 2 + down * box["width"]
