"""Time of whole frames at the paper's full budgets and with `hybrid`, with one and two threads.

Frames are those of the simulated sheet while it moves and bends, by 3 to 5 mm from frame to frame, from frame set to
estimate. The depth camera has 176 × 144 pixels, the colour camera 320 × 240.

Statistic: median and 95th percentile of single frames in one pass, by the clock, and of the processor time of the
tracker's thread; the share of the search without costs and derivatives; by the clock, medians with two threads by those
with one. Until 2026-11-25 it was the least median of three passes, which met the goals of the paper's budgets.
Goals: processor time of one thread, medians: FlexPad with 400 × 16 candidates 25 ms, NURBS with 1000 × 32 100 ms,
`hybrid` with 1000 vertices, depth and colour 5 ms. Two threads are never slower than one.
Seeds: one sequence, with seed 1; Θ does not depend on the number of threads, nor is it judged.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from abs_service.report.content import Column, Section, Table
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.method.rates.cases import cases
from evaluation.method.rates.measuring import Times, measured

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "Rates: whole frames at the paper's budgets and with the default search"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: that are timed, of every case.
        threads: of the kernels, in turn; the first is the one that goals are about.
        scale: of the generations; 1 for the paper's.
    """

    frames: int = 20
    threads: tuple[int, ...] = (1, 2)
    scale: float = 1.0


QUICK = Settings(frames=2, threads=(1,), scale=0.01)


def run(settings: Settings, context: Context) -> Findings:
    """Measures all cases with every number of threads."""
    found: dict[int, Mapping[str, Times]] = {}
    for threads in settings.threads:
        context.progress(f"{threads} threads")
        found[threads] = measured(threads, settings.frames, settings.scale)
    return Findings(
        (*_budgets(settings, found[settings.threads[0]]), *_threads(settings, found)),
        tuple(_section(threads, times) for threads, times in found.items()),
        {str(threads): {part: asdict(one) for part, one in times.items()} for threads, times in found.items()},
    )


def _budgets(settings: Settings, times: Mapping[str, Times]) -> list[Goal]:
    return [
        at_most(f"Processor time of a frame, {one.part}, median", times[one.part].cpu_ms, one.goal_ms, "ms")
        for one in cases(settings.scale)
        if not math.isnan(one.goal_ms)
    ]


def _threads(settings: Settings, found: Mapping[int, Mapping[str, Times]]) -> list[Goal]:
    first, *others = settings.threads
    goals = []
    for threads in others:
        ratios = {part: times.clock_ms / found[first][part].clock_ms for part, times in found[threads].items()}
        part = max(ratios, key=ratios.__getitem__)
        name = f"Median time by the clock with {threads} threads by that with {first}, the largest ({part})"
        goals.append(at_most(name, ratios[part], 1.0))
    return goals


def _section(threads: int, times: Mapping[str, Times]) -> Section:
    columns = (
        Column("frame"), Column("clock, median", "ms", ".2f"), Column("95 %", "ms", ".2f"),
        Column("processor, median", "ms", ".2f"), Column("95 %", "ms", ".2f"), Column("search's own share", "", ".1%"),
    )  # fmt: skip
    rows = tuple((part, *asdict(one).values()) for part, one in times.items())
    title = f"{threads} thread" + ("s" if threads > 1 else "")
    return Section(title, (Table(f"Single frames in one pass, {title}", columns, rows),))
