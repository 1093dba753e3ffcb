"""Processor time of the live page: while a browser shows it, and while none does.

The demo rig runs at 30 Hz; the page is a process of its own, `abs-service view`. The browser is headless Chromium with
a small window and, as it draws without a graphics card, the least priority; its own time is not counted.

Statistic: processor time of the page's process over the time, before a browser opens it, while one shows mesh, points
and images, and after that has been closed; estimates per second beside it.
Goals: at most 0.2 core with one browser, set by the users before the page was written. Without one they want "nothing":
at most 0.02 core, set before the first run, when 0.015 had been measured by hand.
Seeds: the context's seed is that of the simulated device; one run.
"""

import tempfile
import time
from collections.abc import Iterator, Sized
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import tomli_w

from abs_service.report.content import Cell, Column, Section, Table
from evaluation.experiment import Context, Findings, UnavailableError, at_most
from evaluation.service.browser import CHROMIUM, OPTIONS, served
from evaluation.service.live import proc
from evaluation.service.live.rig import TRACKER, demo_table, endpoint_of, free_port
from evaluation.service.live.service import Service
from evaluation.service.live.subscriber import Subscriber

TITLE = "Live page: processor time with and without a browser"

#: Most that the page may use with one browser, and without any [cores].
WITH, WITHOUT = 0.2, 0.02

#: Time that a rig has to track, and a page to open [s]; time after either until it is measured [s].
PATIENCE_S, SETTLED_S = 120.0, 5.0

WIDTH, HEIGHT = 400, 300

_NAME = "page_cost"
PARTS = _BEFORE, _SHOWN, _AFTER = "no browser yet", "one browser", "no browser any more"
_COLUMNS = (Column("page"), Column("processor", "cores", ".3f"), Column("estimates", "Hz", ".1f"))


@dataclass(frozen=True, slots=True)
class Settings:
    """Length of the experiment.

    Attributes:
        duration_s: of each of its three parts [s].
    """

    duration_s: float = 60.0


QUICK = Settings(duration_s=5.0)


@dataclass(frozen=True, slots=True)
class Part:
    """Processor time of the page [cores], and estimates per second [Hz], over one part."""

    cores: float
    rate_hz: float


def run(settings: Settings, context: Context) -> Findings:
    """Measures the page before, while and after a browser shows it."""
    if find_spec("playwright") is None or not Path(CHROMIUM).exists():
        raise UnavailableError(f"needs playwright (`make all`) and {CHROMIUM}")
    with tempfile.TemporaryDirectory(prefix="abs-page-") as folder:
        rig, port = _write_rig(Path(folder), context.seed), free_port()
        with (
            Service(rig),
            Subscriber(endpoint_of(rig), _NAME, TRACKER) as estimates,
            served("view", rig, "--port", str(port)) as page,
        ):
            _await_tracking(estimates)
            parts = {_BEFORE: measured(page, estimates.arrivals, settings.duration_s)}
            context.progress(_SHOWN)
            with _browser(port, Path(folder)):
                parts[_SHOWN] = measured(page, estimates.arrivals, settings.duration_s)
            context.progress(_AFTER)
            parts[_AFTER] = measured(page, estimates.arrivals, settings.duration_s)
    return findings(parts)


def findings(parts: dict[str, Part]) -> Findings:
    """Goals and a table."""
    goals = tuple(
        at_most(f"Processor time of the page, {name}", part.cores, WITH if name == _SHOWN else WITHOUT, "cores")
        for name, part in parts.items()
    )
    rows: tuple[tuple[Cell, ...], ...] = tuple((name, part.cores, part.rate_hz) for name, part in parts.items())
    values = {name: [part.cores, part.rate_hz] for name, part in parts.items()}
    return Findings(goals, (Section("The page's process", (Table("In their order", _COLUMNS, rows),)),), values)


def _write_rig(folder: Path, seed: int) -> Path:
    table = demo_table(_NAME)
    table["devices"]["sim"]["uri"] = f"simulated://sheet?seed={seed}"
    table["record"]["enabled"] = False
    path = folder / "rig.toml"
    path.write_text(tomli_w.dumps(table), encoding="utf-8")
    return path


def _await_tracking(estimates: Subscriber) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not any(one.is_tracking for one in estimates.arrivals[-1:]):
        if time.monotonic() > end_s:
            raise TimeoutError(f"nothing is tracked after {PATIENCE_S:g} s")
        time.sleep(0.1)


@contextmanager
def _browser(port: int, folder: Path) -> Iterator[None]:
    """A browser of the least priority that shows the page and has its status."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - not there without the tools

    program = folder / "chromium"
    program.write_text(f'#!/bin/sh\nexec nice -n 19 {CHROMIUM} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=OPTIONS)
        shown = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        shown.goto(f"http://127.0.0.1:{port}", timeout=1e3 * PATIENCE_S)
        shown.get_by_text("Tracking").first.wait_for(timeout=1e3 * PATIENCE_S)
        try:
            yield
        finally:
            browser.close()


def measured(page: int, arrivals: Sized, duration_s: float) -> Part:
    """Processor time and estimates of so many seconds, once it has settled."""
    time.sleep(SETTLED_S)
    begin_s, cpu_s, number = time.monotonic(), proc.usage(page).cpu_s, len(arrivals)
    time.sleep(duration_s)
    took_s = time.monotonic() - begin_s
    return Part((proc.usage(page).cpu_s - cpu_s) / took_s, (len(arrivals) - number) / took_s)
