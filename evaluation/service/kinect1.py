"""CPU time and losses of receiving a Kinect v1, through unmodified libusb from an emulated camera.

Statistic: share of the shown images that arrived, where no packet was lost; CPU time of a stream. Images that came too
late, because this process was not scheduled, are lost like any other, and reported beside.
Goal: at least 99 % in every case.
Seeds: none; one run of 20 s for each case.
"""

import json
import sys
import time
from dataclasses import dataclass

import numpy as np

from abs_service.report.content import Cell, Column, Section, Table
from drivers.kinect1 import unpacking
from drivers.kinect1.reference_plane import ReferencePlane
from drivers.kinect1.transport.packets import DEPTH
from evaluation.experiment import Context, Findings, UnavailableError, at_least
from evaluation.service.kinect1_emulation import testbed
from evaluation.service.kinect1_receiver import Outcome

TITLE = "Kinect v1: whole images and CPU time, by emulated cameras"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        duration_s: of each case [s].
        cases: number of the rows of `CASES` that are measured, from the first on.
    """

    duration_s: float = 20.0
    cases: int = 6


QUICK = Settings(3.0, 1)

#: Streams, and the share of packets lost by each camera.
CASES = (
    ("depth", (0.0,)),
    ("color", (0.0,)),
    ("ir", (0.0,)),
    ("depth,color", (0.0,)),
    ("depth,color", (0.01,)),
    ("depth,color", (0.0, 0.0)),
)

_COLUMNS = (
    Column("cameras"), Column("streams"), Column("packets lost", "", ".0%"), Column("images that arrived", "", ".2%"),
    Column("late images, warm-up included"), Column("CPU per stream", "of a core", ".1%"),
    Column("emulator", "of a core", ".1%"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Receives from every case's cameras.

    Raises:
        UnavailableError: umockdev is not installed.
    """
    if reason := testbed.why_not():
        raise UnavailableError(reason)
    rows: list[tuple[Cell, ...]] = []
    for streams, losses in CASES[: settings.cases]:
        context.progress(f"{streams}, {len(losses)} cameras")
        rows.append(_row(streams, losses, settings.duration_s))
    arrived = [float(row[3]) for row, (_, losses) in zip(rows, CASES) if not any(losses)]  # type: ignore[arg-type]
    text = f"Unpacking a depth image and looking up its distances takes {_unpacking_ms():.2f} ms."
    return Findings(
        (at_least("Images that arrived where no packet was lost, the lowest share", min(arrived), 0.99),),
        (Section("Received images", (Table("Every case", _COLUMNS, tuple(rows)), text)),),
        {"rows": rows},
    )


def _row(streams: str, losses: tuple[float, ...], duration_s: float) -> tuple[Cell, ...]:
    outcomes = _measure(streams, losses, duration_s)
    delivered, shown = sum(one.delivered for one in outcomes), sum(one.shown for one in outcomes)
    late = sum(one.late for one in outcomes)
    count = len(losses) * len(streams.split(","))
    cpu, emulator = (each / count / outcomes[0].duration_s for each in (outcomes[0].cpu_s, outcomes[0].emulator_cpu_s))
    return (len(losses), streams, losses[0], delivered / shown, late, cpu, emulator)


def _measure(streams: str, losses: tuple[float, ...], duration_s: float) -> list[Outcome]:
    program = [sys.executable, "-m", "evaluation.service.kinect1_receiver", str(duration_s), *map(str, losses)]
    done = testbed.run([*program, "--streams", streams], timeout_s=duration_s + 120, cameras=len(losses))
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return [Outcome(**json.loads(line)) for line in done.stdout.splitlines()]


def _unpacking_ms() -> float:
    packed = np.random.default_rng(1).integers(0, 256, DEPTH.image_bytes, np.uint8)
    table = ReferencePlane().table()
    unpacking.depth(packed, table, DEPTH.height, DEPTH.width)
    begin_s = time.process_time()
    for _ in range(100):
        unpacking.depth(packed, table, DEPTH.height, DEPTH.width)
    return 10 * (time.process_time() - begin_s)
