"""The pictures of the page in the documentation: a rig, the images of a recording, and its slider of time.

python -m evaluation.pictures.page_views docs/images

Needs Chromium. The rig is that of README's moving picture; that which is seen live is slower, as the browser draws
without a graphics card beside it.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from evaluation.pictures.live_page import DRAWN_S, PORT, RIG, open_page, open_recording, record
from evaluation.service.browser import CHROMIUM, OPTIONS, served

#: Rate [Hz] and speed of the simulated cameras that are seen live, and the time that the page has to draw them [s].
SLOW, SETTLED_S = "rate=5&speed=0.17", 12.0

#: Time of the recording that is shown [s].
AT_S = 4.2

#: Size of the window [px].
WIDTH, HEIGHT = 1280, 760


def _of_rig(browser: Browser, picture: Path) -> None:
    page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    open_page(page)
    page.get_by_text("Tracking").first.wait_for(timeout=120_000)
    time.sleep(SETTLED_S)
    page.screenshot(path=picture)
    page.close()


def _of_recording(browser: Browser, recording: Path, images: Path, slider: Path) -> None:
    with served("view", recording, "--port", str(PORT), "--view-only"):
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        open_recording(page, AT_S)
        page.locator("input[type=checkbox]:visible").first.click()  # the residual
        residual = page.get_by_text("residual up to")
        residual.wait_for()
        page.mouse.move(WIDTH - 200, HEIGHT - 100)
        page.mouse.wheel(0, 10_000)
        time.sleep(10 * DRAWN_S)
        page.screenshot(path=images)
        page.mouse.wheel(0, -10_000)
        page.get_by_role("tab", name="View").click()
        time.sleep(10 * DRAWN_S)
        page.screenshot(path=slider)


def main() -> None:
    """Photographs a rig and a recording."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as name:
        slow = Path(name) / "paper.toml"
        slow.write_text(RIG.read_text("utf-8").replace("sheet?", f"sheet?{SLOW}&"), "utf-8")
        recording = record(Path(name))
        with served("run", slow, "--view", "--view-port", str(PORT), "--out", name):
            os.nice(19)  # the browser, which would leave too little time to the rig
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
                _of_rig(browser, folder / "view.png")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
            _of_recording(browser, recording, folder / "view_images.png", folder / "view_recording.png")


if __name__ == "__main__":
    main()
