"""The moving picture of the page in the README: a recording of simulated cameras, photographed estimate by estimate.

python -m evaluation.pictures.live_page docs/images/live.webp

Needs Chromium. Without a graphics card it draws a few pictures a second, so the page stands still for each of them; the
moving picture has the speed of the recording.
"""

import argparse
import io
import subprocess
import tempfile
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Error, Page, sync_playwright

from evaluation.service.browser import CHROMIUM, OPTIONS, SERVICE, served

#: Cameras of today, which see a printed sheet.
RIG = Path(__file__).parents[2] / "examples" / "rigs" / "paper.toml"

#: Length of the recording [s], the times that are shown [s], and estimates of the recording for each picture.
DURATION_S, FROM_S, TO_S, STEP = 14, 2.0, 9.0, 2
#: Width of the picture [px], and the time in which the page has drawn a step [s].
WIDTH, DRAWN_S = 800, 0.5

PORT = 8099

#: Words about the missing graphics card, and those of buttons.
HIDDEN = ".mantine-Notifications-root, .mantine-Tooltip-tooltip"


def record(folder: Path) -> Path:
    """Records the rig and tracks every image of it; returns the recording with images and estimates."""
    tracked = folder / "paper_replay.mcap"
    subprocess.run([*SERVICE, "run", RIG, "--duration", str(DURATION_S), "--out", folder], check=True)
    subprocess.run([*SERVICE, "replay", next(folder.glob("*.mcap")), "--images", "--out", tracked], check=True)
    return tracked


def open_page(page: Page) -> None:
    """Waits for the page."""
    deadline_s = time.monotonic() + 60
    while True:
        try:
            page.goto(f"http://127.0.0.1:{PORT}")
            break
        except Error:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.3)
    page.add_style_tag(content=f"{HIDDEN} {{ display: none !important }}")


def open_recording(page: Page, at_s: float) -> None:
    """Waits for the page, stops its recording at a time, and turns to its images."""
    open_page(page)
    page.get_by_role("button", name="Pause").click(timeout=120_000)
    page.get_by_role("button", name="Play").wait_for()
    at = page.get_by_role("textbox").first
    at.fill(str(at_s))
    at.press("Enter")
    page.get_by_role("tab", name="Images").click()  # the time counts when its field is left


def _photographs(page: Page) -> list[Image.Image]:
    """Pictures of the page from the first to the last time."""
    found: list[Image.Image] = []
    while float(page.get_by_role("textbox").first.input_value()) < TO_S:
        for _ in range(STEP):
            page.get_by_role("button", name="Forward").click()
            time.sleep(DRAWN_S / STEP)
        image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        found.append(image.resize((WIDTH, image.height * WIDTH // image.width), Image.Resampling.LANCZOS))
    return found


def main() -> None:
    """Records and photographs the rig."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    picture = parser.parse_args().picture
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        recording = record(Path(name))
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        with served("view", recording, "--port", str(PORT), "--view-only"):
            page = browser.new_page(viewport={"width": 1180, "height": 640})
            open_recording(page, FROM_S)
            images = _photographs(page)
        browser.close()
    period_ms = round(1000 * (TO_S - FROM_S) / len(images))
    images[0].save(picture, save_all=True, append_images=images[1:], duration=period_ms, loop=0, quality=45, method=5)


if __name__ == "__main__":
    main()
