"""The page in a headless browser, of a running rig and of a recording."""

import re
import signal
import socket
import time
from pathlib import Path

import pytest

from tests.abs_service.commands.estimated_recording import write_estimated
from tests.system.running import START_S, RigListener, abs_service, wait_until

sync_api = pytest.importorskip("playwright.sync_api")
pytest.importorskip("viser")

CHROMIUM = "/usr/bin/chromium"
OPTIONS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
    "--use-angle=swiftshader",
]

#: A rig with two trackers, called left and right.
PAIR = Path(__file__).parents[2] / "examples" / "rigs" / "two_trackers.toml"

PATIENCE_S = 120  # a browser that renders in software, beside a rig, on a machine whose other core runs other tests

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(800)]


@pytest.fixture
def browser():
    """Chromium; skipped where it is missing."""
    with sync_api.sync_playwright() as playwright:
        try:
            opened = playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        except sync_api.Error as error:
            pytest.skip(f"no Chromium: {str(error).splitlines()[0]}")
        yield opened
        opened.close()


@pytest.fixture
def port():
    """A free port."""
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        return unused.getsockname()[1]


def _opened(browser, port, **screen):
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


def _says(page, text):
    """Waits until the status or an answer holds a text."""
    page.get_by_text(text).first.wait_for()


def _box(element) -> dict[str, float]:
    """Place of an element, which has none while the page draws it anew."""
    return wait_until(element.bounding_box, PATIENCE_S, "a place of the element")


def _picture(page) -> bytes:
    return page.locator("canvas").first.screenshot()


def _chosen_by_a_click(page, listener) -> int:
    """Version of the mesh that is made after a click in the middle of the scene, at which the first view is aimed."""
    return _chosen(page, listener, "Choose the object", "Click the object", lambda: page.mouse.click(*_at(page, 0, 0)))


def _chosen(page, listener, button, hint, gesture) -> int:
    """Version of the mesh that is made after a gesture in the scene."""
    version = listener.states()[-1][1].mesh_version
    page.get_by_role("button", name=button).click()
    _says(page, hint)
    gesture()
    wait_until(lambda: listener.states()[-1][1].mesh_version > version, PATIENCE_S, "a mesh of what was chosen")
    _says(page, "To keep this choice")
    return listener.states()[-1][1].mesh_version


def _at(page, right, down):
    """A place in the scene, from its middle, in widths of the scene; a warning of the browser's covers the top."""
    box = _box(page.locator("canvas").first)
    return box["x"] + (0.5 + right) * box["width"], box["y"] + box["height"] / 2 + down * box["width"]


def _draw_box(page):
    page.mouse.move(*_at(page, -0.45, -0.2))
    page.mouse.down()
    page.mouse.move(*_at(page, 0.1, 0.1), steps=4)
    page.mouse.move(*_at(page, 0.45, 0.5), steps=4)
    page.mouse.up()


def _draw_lasso(page):
    for corner in ((-0.45, -0.2), (0.45, -0.2), (0.45, 0.5), (-0.45, 0.5), (-0.45, -0.2)):
        page.mouse.click(*_at(page, *corner))
        time.sleep(0.5)


def test_a_box_and_a_lasso_choose_the_object(run, rig_file, launch, browser, port):
    _, listener = run
    launch("view", rig_file, "--port", port)
    page, _ = _opened(browser, port)
    _says(page, "Tracking")
    for button, hint, draw in (
        ("Draw a box", "press in one corner", _draw_box),
        ("Draw a lasso", "corner by corner", _draw_lasso),
    ):
        _chosen(page, listener, button, hint, lambda draw=draw: draw(page))
        _says(page, "polygon = [[")


def test_the_page_shows_a_mesh_that_moves_acts_and_connects_again(run, rig_file, endpoint, launch, browser, port):
    rig, listener = run
    server = launch("view", rig_file, "--port", port)
    page, opened_s = _opened(browser, port)
    print(f"the page opened after {opened_s:.1f} s")
    _says(page, "Tracking")
    page.get_by_role("checkbox").nth(1).click()  # without the measured points, only the mesh moves
    time.sleep(1.0)
    before = _picture(page)
    wait_until(lambda: _picture(page) != before, PATIENCE_S, "motion of the mesh")

    version = listener.states()[-1][1].mesh_version
    page.get_by_role("button", name="Reinitialise").click()
    wait_until(lambda: listener.states()[-1][1].mesh_version > version, PATIENCE_S, "a new mesh")
    _says(page, "New mesh, version")
    version = _chosen_by_a_click(page, listener)
    column, row = re.findall(r"\d+", page.inner_text("body").partition("pixel = ")[2])[:2]
    done = abs_service("reinitialize", rig_file, "sheet", "--seed", column, row)
    assert f'type = "seed"\npixel = [{column}, {row}]\n' in done.stdout
    wait_until(lambda: listener.states()[-1][1].mesh_version > version, PATIENCE_S, "a new mesh from the command line")

    page.get_by_role("button", name="Start recording").click()
    _says(page, "it records as long as it runs")
    page.get_by_role("tab", name="Images").click()
    page.get_by_text("Residual", exact=True).wait_for()
    page.locator("input[type=checkbox]:visible").first.click()
    _says(page, "residual up to")
    page.get_by_role("tab", name="Plots").click()
    _says(page, "components that move most")

    assert not page.get_by_text("lost its connection").first.is_visible()
    server.send_signal(signal.SIGTERM)
    assert server.wait(PATIENCE_S) == 0
    _says(page, "This page has lost its connection")
    said = len(listener.health("view"))
    launch("view", rig_file, "--port", port)
    wait_until(lambda: len(listener.health("view")) > said, PATIENCE_S, "health of the second page")
    page.get_by_text("lost its connection").first.wait_for(state="hidden")
    _says(page, "Tracking")

    rig.send_signal(signal.SIGTERM)
    rig.wait(PATIENCE_S)
    _says(page, "Nothing heard from the rig")
    launch("run", rig_file, "--no-record", "--json")
    with RigListener(endpoint) as again:
        wait_until(again.tracks_since(0), START_S, "TRACKING")
    _says(page, "Tracking")


def test_all_trackers_of_a_rig_are_shown(endpoint, launch, browser, port, tmp_path):
    rig_file = tmp_path / "pair.toml"
    rig_file.write_text(f'{PAIR.read_text("utf-8")}\n[bus]\nendpoint = "{endpoint}"\n', encoding="utf-8")
    launch("run", rig_file, "--no-record", "--json")
    launch("view", rig_file, "--port", port)
    page, _ = _opened(browser, port)
    for tracker in ("left", "right"):
        _says(page, f"{tracker}: Tracking")


def test_a_page_that_only_shows_has_no_buttons(run, rig_file, launch, browser, port):
    launch("view", rig_file, "--port", port, "--view-only")
    page, _ = _opened(browser, port)
    _says(page, "Tracking")
    for name in ("Reinitialise", "Choose the object", "Start recording", "Stop recording"):
        assert page.get_by_role("button", name=name).count() == 0


def test_a_recording_is_played_to_its_end_stepped_back_and_played_again(tmp_path, launch, browser, port):
    server = launch("view", write_estimated(tmp_path / "x.mcap"), "--port", port)
    page, _ = _opened(browser, port)
    _says(page, "Tracking")
    page.get_by_role("button", name="Play", exact=True).wait_for()  # it is over, and says so
    for status in ("Object lost", "Tracking with doubts"):
        page.get_by_role("button", name="Back").click()
        _says(page, status)
    page.get_by_role("tab", name="Images").click()
    _says(page, "tof/depth")
    page.get_by_role("button", name="Play", exact=True).click()
    page.get_by_text("Tracking with doubts").first.wait_for(state="hidden")
    assert page.get_by_role("button", name="Reinitialise").count() == 0
    server.send_signal(signal.SIGTERM)
    assert server.wait(PATIENCE_S) == 0


def test_on_a_phone_the_panel_leaves_half_of_the_scene_and_its_controls_are_in_reach(tmp_path, launch, browser, port):
    launch("view", write_estimated(tmp_path / "x.mcap"), "--port", port)
    page, _ = _opened(browser, port, viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True)
    _says(page, "Tracking")
    play = page.get_by_role("button", name="Play", exact=True)
    play.wait_for()
    assert _box(page.locator("canvas").first)["width"] == 390
    for box in (_box(page.locator(".abs-status").first), _box(play)):
        assert 0 <= box["x"] <= 390 - box["width"]
        assert 844 / 3 <= box["y"] <= 844 - box["height"]
    page.get_by_role("button", name="Back").tap()
    _says(page, "Object lost")
    page.get_by_role("tab", name="Images").tap()
    _says(page, "tof/depth")
