"""The toy's sequence as findings: as it is, at the sensor's rate, and with parts missing."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from abs_service.report import plots
from abs_service.report.content import Cell, Column, Picture, Section, Table, drawing
from evaluation.experiment import Findings, Goal, at_least, at_most
from evaluation.inputs.recordings.agreement import vertex_errors
from evaluation.inputs.recordings.toy import dropouts
from evaluation.inputs.recordings.toy.dropouts import Pace
from evaluation.inputs.recordings.toy.toy import CAMERA, RATE_HZ, Toy, TrackedFrame, medians, worst

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Part of the image to show: left, right, bottom, top [px].
WINDOW = (60, 170, 165, 55)
_COLORS, _SCALE = "coolwarm", Normalize(-6.0, 6.0)  # mm

#: What is wanted of the median of all frames.
RESIDUAL_MM, COVERED = 1.2, 0.85

_COLUMNS = (
    Column("sequence"),
    Column("frames", format="d"),
    Column("TRACKING", "%", ".1f"),
    Column("forward", "mm", ".2f"),
    Column("worst", "mm", ".2f"),
    Column("backward", "mm", ".2f"),
    Column("worst", "mm", ".2f"),
    Column("vertices inside", "%", ".1f"),
    Column("mask covered", "%", ".1f"),
    Column("worst", "%", ".1f"),
)


def findings(folder: Path, frames: int, seed: int, progress: Callable[[str], None]) -> Findings:
    """Tracks the sequence in every way.

    Args:
        folder: with the images.
        frames: how many of them, from the first on.
        seed: of what is missing.
        progress: called with the current step.
    """
    toy = Toy(folder, frames)
    progress("the toy as it is")
    whole = list(toy.follow(time.process_time_ns))
    runs: dict[str, list[TrackedFrame]] = {"as it is": whole}
    progress("the toy in real time")
    runs[f"with {toy.budget_ms:g} ms for a search"] = live = list(
        toy.follow(time.process_time_ns, budget_ms=toy.budget_ms)
    )
    for name, change in dropouts.changes(np.random.default_rng(seed)).items():
        progress(f"the toy with {name}")
        runs[name] = list(toy.follow(time.process_time_ns, change))
    kept = dropouts.pace([frame.solve_ms for frame in live])
    gapped = runs["one second missing"]
    back = dropouts.recovery(gapped, whole) if frames > sum(dropouts.GAP) else None
    sections = (
        Section("Soft toy: agreement with the depth image", (_WHAT, _table(runs), _picture(toy, whole))),
        Section("Soft toy: live", (_live_text(kept, live),)),
    )
    return Findings(_goals(runs, kept, back), sections, _values(runs, kept, back))


_WHAT = (
    "Forward: median |synthesised − measured distance| over the vertices inside the object's mask; backward: median "
    "distance of the measured points in the mask from the mesh; both of the median and of the worst frame. Missing "
    "frames and pixels are missing for the tracker, not for these numbers."
)


def _goals(runs: Mapping[str, Sequence[TrackedFrame]], kept: Pace, back: int | None) -> tuple[Goal, ...]:
    whole = medians(runs["as it is"])
    share = min(np.mean([frame.tracking for frame in run]) for run in runs.values())
    goals = (
        at_most("Soft toy: forward residual, median", whole.forward_mm, RESIDUAL_MM, "mm"),
        at_most("Soft toy: backward residual, median", whole.backward_mm, RESIDUAL_MM, "mm"),
        at_least("Soft toy: share of the mask that is covered, median", whole.covered, COVERED),
        at_most(f"Soft toy: frames missed at {RATE_HZ:g} Hz", kept.missed, 0),
        at_least("Soft toy: TRACKING share, the worst of all dropouts", float(share), 0.95),
    )
    if back is None:
        return goals
    return (*goals, at_most("Soft toy: frames until the residual has recovered after a gap of one second", back, 3))


def _table(runs: Mapping[str, Sequence[TrackedFrame]]) -> Table:
    return Table("Residuals and coverage", _COLUMNS, tuple(_row(name, run) for name, run in runs.items()))


def _row(name: str, run: Sequence[TrackedFrame]) -> tuple[Cell, ...]:
    median, extreme = medians(run), worst(run)
    tracking = 100 * float(np.mean([frame.tracking for frame in run]))
    residuals = (median.forward_mm, extreme.forward_mm, median.backward_mm, extreme.backward_mm)
    return (name, len(run), tracking, *residuals, 100 * median.inside, 100 * median.covered, 100 * extreme.covered)


def _live_text(kept: Pace, live: Sequence[TrackedFrame]) -> str:
    took = np.array([frame.solve_ms for frame in live[1:]])
    return (
        f"A frame takes {np.median(took):.1f} ms of one processor (95 % take less than {np.quantile(took, 0.95):.1f} "
        f"ms). At {RATE_HZ:g} frames/s, {kept.missed} of {len(took)} would be overtaken by a newer one; the "
        f"estimates are {np.median(kept.age_ms):.1f} ms old in the median and {kept.age_ms.max():.1f} ms at worst, "
        "the first frame left out, in which the mesh is made."
    )


def _values(runs: Mapping[str, Sequence[TrackedFrame]], kept: Pace, back: int | None) -> dict[str, object]:
    table = {name: _row(name, run)[1:] for name, run in runs.items()}
    solve_ms = [frame.solve_ms for frame in runs["as it is"]]
    return {"toy": {"runs": table, "missed": kept.missed, "age_ms": kept.age_ms, "solve_ms": solve_ms, "back": back}}


def _picture(toy: Toy, frames: Sequence[TrackedFrame]) -> Picture:
    """The mesh over the edges of four frames, coloured by its depth residual."""
    figure = plots.figure(14, 4.2)
    shown = [frames[i] for i in np.linspace(0, len(frames) - 1, 4).astype(int)]
    for axes, frame in zip(figure.subplots(1, 4), shown):
        _draw(axes, toy, frame)
    mappable = ScalarMappable(_SCALE, _COLORS)
    figure.colorbar(mappable, ax=figure.axes, label="synthesised − measured distance [mm]", shrink=0.85)
    return drawing(figure, "The mesh over the edges of four frames; black: the mask", "Meshes over edges of images")


def _draw(axes: "Axes", toy: Toy, frame: TrackedFrame) -> None:
    reference = toy.references[frame.index]
    axes.imshow(255 - reference.edges // 3, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    vertices = frame.estimate.vertices
    error, inside = vertex_errors(vertices, reference.distance, reference.mask, CAMERA)
    axes.contour(reference.mask, [0.5], colors="black", linewidths=0.8)
    u, v = CAMERA.project(vertices).T
    axes.triplot(u, v, frame.faces, color="0.55", linewidth=0.3)
    known = np.isfinite(error)
    axes.scatter(u[known], v[known], c=error[known] * 1e3, s=5, cmap=_COLORS, norm=_SCALE, zorder=3)
    found = frame.agreement
    axes.set_title(f"{found.forward_mm:.1f} / {found.backward_mm:.1f} mm, {inside.mean():.0%} inside", fontsize=10)
    axes.set_xlim(*WINDOW[:2])
    axes.set_ylim(*WINDOW[2:])
    axes.set_axis_off()
