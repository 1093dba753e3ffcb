"""Growth of cost: by vertices, control points, pixels, sensors, candidates and trackers.

Frames are those of the simulated sheet while it moves, one tracker for each number, all in turn. Trackers are processes
of the service on a recording of the rig of `frame_budget`, played at 3 Hz so that they keep up.

Statistic: processor time of a frame of the tracker's thread, median over the frames in one pass; of the service,
processor time of all its trackers by the number of exposures. R² of a law with two parameters, fitted by least squares;
its form was chosen before: linear, and for the parameters in Θ quadratic. Walls: the number at which the law reaches
the 33 ms between two frames. Then as many rigs with one tracker run side by side as the laws say for 70 % of the cores
of this machine.
Goals: R² at least 0.98 for every law. Of the rigs side by side: at most 1 % of the frame sets passed over, none lost
that nobody counts, at most 1.2 times the cores of the laws.
Seeds: one sequence, with seed 1, and for the trackers one recording with the context's seed + 1.

Easier than reality: the sheet covers an eighth of the image, and several depth sensors are one and the same, several
times. Times of a machine on which others work are longer than those of an idle one, but by about the same factor.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from abs_service.report import plots
from abs_service.report.content import Column, Picture, Section, Table, drawing
from evaluation.experiment import Context, Findings, Goal, at_least
from evaluation.service.frame_budget.rig import RATE_HZ
from evaluation.service.growth import services
from evaluation.service.growth.frames import FIRST, Axis, Point, axes, measure
from evaluation.service.growth.laws import Law, fit

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "Growth: the law of every cost, and where the next wall is"

#: Time between two frames [ms].
INTERVAL_MS = 1e3 / RATE_HZ

#: Least share of the variance that a law explains.
DETERMINATION = 0.98


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: that every tracker takes.
        trackers: numbers of trackers that the service runs with.
        live_s: time that each, and the rigs side by side, are observed [s].
    """

    frames: int = 30
    trackers: tuple[int, ...] = (1, 2, 3, 4)
    live_s: float = 12.0


QUICK = Settings(frames=FIRST + 1, trackers=())


def run(settings: Settings, context: Context) -> Findings:
    """Measures every axis, and the service with every number of trackers."""
    found: dict[str, tuple[Sequence[Point], Law]] = {}
    sections = []
    for axis in axes():
        context.progress(axis.unit)
        points = measure(axis, settings.frames)
        law = fit([one.number for one in points], [one.median_ms for one in points], axis.power)
        found[axis.unit] = points, law
        sections.append(_section(axis, points, law))
    laws = {name: law for name, (_, law) in found.items()}
    goals: list[Goal] = []
    values: dict[str, Any] = {"points": {name: [asdict(one) for one in points] for name, (points, _) in found.items()}}
    if settings.trackers:
        measured = services.measure(settings.trackers, settings.live_s, context.seed + 1, context.progress)
        laws["trackers"] = law = measured.costs.trackers
        times = [one["track"] for one in measured.by_trackers.values()]
        sections += services.sections(measured, _drawn("trackers", list(measured.by_trackers), times, law))
        goals, values = services.goals(measured), values | services.values(measured)
    fits = [at_least(f"R² of the law by {name}", law.determination, DETERMINATION) for name, law in laws.items()]
    return Findings(
        (*fits, *goals),
        (_overview(laws), *sections),
        values | {"laws": {name: asdict(law) for name, law in laws.items()}},
    )


def _overview(laws: Mapping[str, Law]) -> Section:
    columns = (
        Column("by"), Column("law"), Column("R²", format=".4f"),
        Column(f"reaches {INTERVAL_MS:.0f} ms at", format=".3g"),
    )  # fmt: skip
    rows = tuple((name, law.in_words(), law.determination, law.wall(INTERVAL_MS)) for name, law in laws.items())
    text = "A wall beyond the largest number that was measured is an extrapolation."
    return Section("Laws", (Table("Processor time of a frame; of all trackers together", columns, rows), text))


def _section(axis: Axis, points: Sequence[Point], law: Law) -> Section:
    columns = (
        Column(axis.unit, format=".0f"), Column("median", "ms", ".2f"), Column("95 %", "ms", ".2f"),
        Column("law", "ms", ".2f"), Column("TRACKING", "", ".0%"),
    )  # fmt: skip
    rows = tuple((one.number, one.median_ms, one.p95_ms, law.time(one.number), one.tracking) for one in points)
    numbers, times = [one.number for one in points], [one.median_ms for one in points]
    picture = _drawn(axis.unit, numbers, times, law)
    return Section(f"By {axis.unit}", (axis.condition, Table("Processor time of a frame", columns, rows), picture))


def _drawn(unit: str, numbers: Sequence[float], times: Sequence[float], law: Law) -> Picture:
    figure = plots.figure(5, 3)
    axes_ = figure.add_subplot()
    line = np.linspace(0, max(numbers), 100)
    axes_.plot(line, [law.time(one) for one in line], color="0.6")
    axes_.plot(numbers, times, "o")
    axes_.set(xlabel=unit, ylabel="processor time / ms", xlim=(0, None), ylim=(0, None))
    return drawing(figure, f"{law.in_words()}, R² = {law.determination:.4f}", f"Times by {unit}, with the law")
