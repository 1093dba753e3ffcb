"""The sheet of paper as findings: eight ways of tracking it with nothing but defaults, against measured points."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service import Estimate
from abs_service.report import plots
from abs_service.report.content import Cell as TableCell
from abs_service.report.content import Column, Picture, Section, Table, drawing
from evaluation.experiment import Findings, Goal, at_least, at_most
from evaluation.inputs.recordings import kinect_paper
from evaluation.inputs.recordings.binding import Points
from evaluation.inputs.recordings.kinect_paper import CAMERA, CELLS, PaperRun, Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What is wanted of every cell, written before the first run: the error of a frame is its points' median.
MEDIAN_MM, WORST_MM = 3.0, 15.0
INSIDE = (85.0, 99.0)  # %
WRONG = 0.0  # %
MESHES = 1

#: Part of the image to show: left, right, bottom, top [px].
WINDOW = (170, 570, 420, 70)

_COLUMNS = (
    Column("cell"),
    Column("TRACKING", "%", ".1f"),
    Column("median", "mm", ".2f"),
    Column("worst frame", "mm", ".2f"),
    Column("p95", "mm", ".2f"),
    Column("largest", "mm", ".1f"),
    Column("across", "mm", ".2f"),
    Column("claimed σ", "mm", ".2f"),
    Column("in 95 % region", "%", ".1f"),
    Column("truth's σ twice", "%", ".1f"),
    Column("wrong", "%", ".1f"),
    Column("points", format="d"),
    Column("beyond", format="d"),
    Column("meshes", format="d"),
    Column("CPU", "ms", ".1f"),
    Column("CPU p95", "ms", ".1f"),
)


def findings(folder: Path, frames: int, cells: int, progress: Callable[[str], None]) -> Findings:
    """Tracks the sheet in every way.

    Args:
        folder: with images and truth.npz.
        frames: how many of the frames with a truth, from the first on; at least two.
        cells: how many of the ways.
        progress: called with the current step.
    """
    known, runs = kinect_paper.truth(folder, frames), []
    for cell in CELLS[:cells]:
        progress(f"the sheet of paper: {cell.name}")
        images = kinect_paper.images(folder, cell, known.numbers[-1])
        runs.append(kinect_paper.follow(cell.name, cell.tracker(), images, known))
    table = errors_table(runs)
    picture, beside = _picture(folder, runs[0], known), kinect_paper.beside_flow(folder, known)
    values = {run.name: _values(run) for run in runs}
    as_numbered = kinect_paper.beside_flow(folder, known, 0)
    by_frame = _by_frame(runs, known.numbers[1:], beside, as_numbered)
    section = Section("Kinect v1: a bent sheet of paper", (_WHAT, table, by_frame, _FLOW, picture))
    return Findings(
        goals(runs, "Kinect paper", f"of {len(runs)} cells", MESHES),
        (section,),
        {"kinect_paper": values, "kinect_paper_beside_flow_px": beside},
    )


def errors_table(runs: Sequence[PaperRun]) -> Table:
    """The errors, one row for each way of tracking."""
    return Table("Errors at measured material points", _COLUMNS, tuple(_row(run) for run in runs))


_WHAT = (
    "All is a user's default: no key is set but cameras and model, so noise is that of a Kinect v1 and the object is "
    "the nearest surface of the first frame, before a wall (0.85 m) and without. The depth image is interpolated from "
    "the measured points and has no noise of its own. Points measured in the first frame are bound to the mesh, and "
    "compared with where they were measured in every eighth frame after it. Median, p95 and across (along the "
    "normal): medians over the frames of the points' quantiles; worst frame: the largest median of a frame; largest: "
    "the largest error of a point. The 95 % region is that of the claimed covariance and the truth's σ of 1 mm an "
    "axis; as the points were bound to measured places, errors of a perfect mesh have that σ twice, which the next "
    "column takes into account. Wrong: TRACKING, while the median is above 5 mm and 3 claimed σ. Beyond: points "
    "beside the first mesh by more than a cell. Meshes: how many the tracker made; points are bound anew to "
    "each in the first frame with a truth that shows it."
)


_FLOW = (
    "The last two columns are no errors of the tracker: they are the median distance of the measured points from where "
    "optical flow takes those of the frame before, image by image. Colours and points of the same number disagree by "
    "up to 6 px (about 6 mm), most where the sheet moves fastest; colours of the next number agree with the points. "
    "So the recording's numbers differ by one, and every depth image is tracked with the colours of the next number. "
    "The depth images between those with points were carried with the optical flow of colours of their own number."
)


def goals(runs: Sequence[PaperRun], name: str, of: str, meshes: int) -> tuple[Goal, ...]:
    """Each for the worst way of tracking, with at most so many meshes; NaN, a lost sheet, misses it."""
    rows = np.array([_numbers(run) for run in runs])
    inside = rows[:, _INSIDE]
    return (
        at_most(f"{name}: median error, the worst {of}", rows[:, _MEDIAN].max(), MEDIAN_MM, "mm"),
        at_most(f"{name}: error of a frame, the worst {of}", rows[:, _WORST].max(), WORST_MM, "mm"),
        at_least(f"{name}: points in their 95 % region, the least {of}", inside.min(), INSIDE[0], "%"),
        at_most(f"{name}: points in their 95 % region, the most {of}", inside.max(), INSIDE[1], "%"),
        at_most(f"{name}: frames that are TRACKING and wrong, the worst {of}", rows[:, _WRONG].max(), WRONG, "%"),
        at_most(f"{name}: meshes that were made, the most {of}", max(run.meshes for run in runs), meshes),
    )


_MEDIAN, _WORST, _INSIDE, _WRONG = 1, 2, 7, 9


def _numbers(run: PaperRun) -> tuple[float, ...]:
    """The numbers of a row up to the share of wrong frames."""
    errors = run.errors
    median = np.array([one.median_mm for one in errors])
    return (
        100 * run.tracking,
        float(np.median(median)),
        float(median.max()),
        float(np.median([one.p95_mm for one in errors])),
        float(np.max([one.maximum_mm for one in errors])),
        float(np.median([one.across_mm for one in errors])),
        _rms([one.claimed_mm for one in errors]),
        100 * float(np.mean([one.inside for one in errors])),
        100 * float(np.mean([one.inside_twice for one in errors])),
        100 * float(np.mean([one.wrong for one in errors])),
    )


def _rms(values: Sequence[float]) -> float:
    """Root mean square of those that are known."""
    known = np.array(values)[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else np.nan


def _row(run: PaperRun) -> tuple[TableCell, ...]:
    times = (float(np.median(run.solve_ms)), float(np.quantile(run.solve_ms, 0.95)))
    return (run.name, *_numbers(run), run.bound, run.beyond, run.meshes, *times)


def _by_frame(
    runs: Sequence[PaperRun],
    numbers: Sequence[int],
    beside: NDArray[np.float64],
    as_numbered: NDArray[np.float64],
) -> Table:
    columns = (Column("frame"), *(Column(run.name, "mm", ".2f") for run in runs))
    columns += (Column("points beside flow", "px", ".2f"), Column("same numbers", "px", ".2f"))
    medians = [{one.number: one.median_mm for one in run.errors} for run in runs]
    rows = (
        (str(number), *(of_run.get(number, float("nan")) for of_run in medians), *misses)
        for number, *misses in zip(numbers, beside, as_numbered, strict=True)
    )
    return Table("Median error in every frame with a truth", columns, tuple(rows))


def _values(run: PaperRun) -> dict[str, object]:
    columns = (
        "number",
        "median_mm",
        "p95_mm",
        "maximum_mm",
        "across_mm",
        "claimed_mm",
        "inside",
        "inside_twice",
        "wrong",
    )
    frames = {name: [getattr(one, name) for one in run.errors] for name in columns}
    status = [one.status.name for one in run.errors]
    return {"row": _row(run)[1:], "status": status, **frames, "solve_ms": run.solve_ms}


def _picture(folder: Path, run: PaperRun, known: Truth) -> Picture:
    """Mesh and measured points over the edges of the first and the last frame with a truth."""
    figure = plots.figure(12, 5.8)
    for axes, place, estimate in zip(figure.subplots(1, 2), (0, -1), run.shown):
        _draw(axes, folder, known.numbers[place], estimate, known.points[place])
    caption = f"{run.name}: mesh and measured points (red) over the edges of the first and the last frame"
    return drawing(figure, caption, "Meshes and points over edges of images")


def _draw(axes: "Axes", folder: Path, number: int, estimate: Estimate, points: Points) -> None:
    edges = np.asarray(cv2.Canny(kinect_paper.color(folder, number), 60, 140), np.uint8)
    axes.imshow(255 - edges // 3, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    axes.triplot(*CAMERA.project(estimate.vertices).T, estimate.faces, color="tab:blue", linewidth=0.4)
    axes.scatter(*CAMERA.project(points).T, s=4, color="tab:red", zorder=3)
    axes.set_title(f"frame {number}", fontsize=10)
    axes.set_xlim(*WINDOW[:2])
    axes.set_ylim(*WINDOW[2:])
    axes.set_axis_off()
