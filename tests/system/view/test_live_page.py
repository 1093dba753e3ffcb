"""The page of a running rig in a headless browser: it shows, acts, and connects again."""

import re
import signal
import time
from pathlib import Path

import pytest

from tests.system.running import START_S, RigListener, abs_service, wait_until
from tests.system.view.browsing import PATIENCE_S, chosen_by_a_click, opened, picture_of, place_of, says

#: Name of the rig of `run`.
RIG = "demo"

#: A rig with two trackers, called left and right.
PAIR = Path(__file__).parents[3] / "examples" / "rigs" / "two_trackers.toml"

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(800)]


def test_the_page_shows_a_mesh_that_moves_acts_and_connects_again(run, rig_file, endpoint, launch, browser, port):
    rig, listener = run
    server = launch("view", rig_file, "--port", port)
    page, opened_s = opened(browser, port)
    print(f"the page opened after {opened_s:.1f} s")
    says(page, "Tracking")
    page.get_by_role("checkbox").nth(1).click()  # without the measured points, only the mesh moves
    time.sleep(1.0)
    before = picture_of(page)
    wait_until(lambda: picture_of(page) != before, PATIENCE_S, "motion of the mesh")
    meshes_are_made_anew(page, listener, rig_file)

    names_and_buttons_are_where_they_belong(page)
    page.get_by_role("tab", name="Images").click()
    page.get_by_text("Residual", exact=True).wait_for()
    page.locator("input[type=checkbox]:visible").first.click()
    says(page, "residual up to")
    page.get_by_role("tab", name="Plots").click()
    says(page, "components that move most")

    assert not page.get_by_text("lost its connection").first.is_visible()
    server.send_signal(signal.SIGTERM)
    assert server.wait(PATIENCE_S) == 0
    says(page, "This page has lost its connection")
    said = len(listener.health("view"))
    launch("view", rig_file, "--port", port)
    wait_until(lambda: len(listener.health("view")) > said, PATIENCE_S, "health of the second page")
    page.get_by_text("lost its connection").first.wait_for(state="hidden")
    says(page, "Tracking")

    rig.send_signal(signal.SIGTERM)
    rig.wait(PATIENCE_S)
    says(page, "Nothing received from the rig")
    launch("run", rig_file, "--no-record", "--json")
    with RigListener(endpoint) as again:
        wait_until(again.tracks_since(0), START_S, "TRACKING")
    says(page, "Tracking")


def names_and_buttons_are_where_they_belong(page):
    says(page, "Always recording")
    start, stop = (page.get_by_role("button", name=f"{one} recording") for one in ("Start", "Stop"))
    assert start.is_disabled()
    assert place_of(start)["y"] == place_of(stop)["y"]
    assert page.get_by_text(RIG, exact=True).first.is_visible()
    assert page.title() == f"{RIG} · abs-service"


def meshes_are_made_anew(page, listener, rig_file):
    """Meshes made anew by the button, by a click on the object, and by the command that the page then names."""
    version = listener.states()[-1][1].mesh_version
    page.get_by_role("button", name="Reinitialise").click()
    wait_until(lambda: listener.states()[-1][1].mesh_version > version, PATIENCE_S, "a new mesh")
    says(page, "New mesh, version")
    version = chosen_by_a_click(page, listener)
    column, row = re.findall(r"\d+", page.inner_text("body").partition("pixel = ")[2])[:2]
    done = abs_service("reinitialize", rig_file, "sheet", "--seed", column, row)
    assert f'type = "seed"\npixel = [{column}, {row}]\n' in done.stdout
    wait_until(lambda: listener.states()[-1][1].mesh_version > version, PATIENCE_S, "a new mesh from the command line")


def test_all_trackers_of_a_rig_are_shown(endpoint, launch, browser, port, tmp_path):
    rig_file = tmp_path / "pair.toml"
    # Two trackers and a browser that renders in software are too much for two slow cores at 30 Hz.
    pair = PAIR.read_text("utf-8").replace("seed=1", "seed=1&rate=5")
    rig_file.write_text(f'{pair}\n[bus]\nendpoint = "{endpoint}"\n', encoding="utf-8")
    launch("run", rig_file, "--no-record", "--json")
    launch("view", rig_file, "--port", port)
    page, _ = opened(browser, port)
    for tracker in ("left", "right"):
        says(page, f"{tracker}: Tracking")
