"""The page of a rig or a recording as a process of its own, and the browser that shows it without a graphics card."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CHROMIUM = "/usr/bin/chromium"
OPTIONS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader"]

SERVICE = [sys.executable, "-m", "abs_service"]


@contextmanager
def served(command: str, source: Path, *options: str) -> Iterator[int]:
    """The page that `view` serves of a rig or a recording, or `run` of a rig; the number of its (first) process."""
    page = subprocess.Popen([*SERVICE, command, source, *options], stdout=subprocess.DEVNULL)
    try:
        yield page.pid
    finally:
        page.terminate()
        page.wait()
