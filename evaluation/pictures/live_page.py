"""The moving picture of the live page in the README: a recording of the demo rig, played slowly and photographed.

python -m evaluation.pictures.live_page docs/images/live.webp

Needs Chromium. Without a graphics card it draws a few pictures a second, so the recording is played at a small part of
its speed, which is what the page's rates show; the picture moves at the speed of the recording.
"""

import argparse
import io
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Error, Page, sync_playwright

#: Length of the recording [s], and the speed at which it is played.
DURATION_S, SPEED = 14, 0.06
#: Length of the picture [s] and its width [px].
SHOWN_S, WIDTH = 6.0, 800

PORT = 8099
CHROMIUM = "/usr/bin/chromium"
OPTIONS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader"]

SERVICE = [sys.executable, "-m", "abs_service"]


@contextmanager
def _playing(recording: Path, folder: Path) -> Iterator[None]:
    """The recording and its page, as processes of their own."""
    replay = subprocess.Popen([*SERVICE, "replay", recording, "--speed", str(SPEED), "--out", folder / "replay"])
    page = subprocess.Popen([*SERVICE, "view", "--port", str(PORT), "--view-only"])
    try:
        yield
    finally:
        for process in (page, replay):
            process.terminate()
            process.wait()


def _open(page: Page) -> None:
    """Waits until the page says that it tracks, and turns to its images."""
    deadline_s = time.monotonic() + 60
    while True:
        try:
            page.goto(f"http://127.0.0.1:{PORT}")
            break
        except Error:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.3)
    page.get_by_text("Tracking").first.wait_for(timeout=120_000)
    page.add_style_tag(
        content=".mantine-Notifications-root { display: none !important }"
    )  # of the missing graphics card
    page.get_by_role("tab", name="Images").click()
    time.sleep(4)


def _photographs(page: Page) -> list[Image.Image]:
    """Pictures of the page until the time to show has been played."""
    end_s, found = time.monotonic() + SHOWN_S / SPEED, []
    while time.monotonic() < end_s:
        image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        found.append(image.resize((WIDTH, image.height * WIDTH // image.width), Image.Resampling.LANCZOS))
    return found


def main() -> None:
    """Records, plays and photographs the demo rig."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    picture = parser.parse_args().picture
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        subprocess.run([*SERVICE, "run", "--duration", str(DURATION_S), "--out", folder], check=True)
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        with _playing(next(folder.glob("*.mcap")), folder):
            page = browser.new_page(viewport={"width": 1180, "height": 640})
            _open(page)
            images = _photographs(page)
        browser.close()
    period_ms = round(1000 * SHOWN_S / len(images))
    images[0].save(picture, save_all=True, append_images=images[1:], duration=period_ms, loop=0, quality=45, method=5)


if __name__ == "__main__":
    main()
