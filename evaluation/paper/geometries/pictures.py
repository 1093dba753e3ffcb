"""Pictures of E1: what the camera sees, how it errs, and how the trackers err."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from abs_service.report import figures, plots
from abs_service.report.content import Picture, drawing
from evaluation.paper.geometries.measuring import SequenceResult
from evaluation.scenes.printed_sheet import PrintedSheet
from evaluation.scenes.surfaces import SplineSurface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Frame whose images are shown: the sheet is bent most at a quarter of its period.
SHOWN = 30


def pictures(first: Sequence[SequenceResult]) -> tuple[Picture, ...]:
    """Pictures of the last geometry's camera, and of all geometries' errors."""
    one = first[-1]
    scene = PrintedSheet(one.job.sheet, one.job.sensor, one.job.texture)
    view = scene.view(scene.control(SHOWN))
    measured = one.job.sensor.measure(view, np.random.default_rng(one.job.seed))
    sigma = np.where(view.share > 0, one.job.sensor.deviation(view.distance, one.job.sensor.amplitude(view)), np.nan)
    depth = figures.image_map(measured.distance.astype(float), "measured distance [m]")
    deviation = figures.image_map(1e3 * sigma, "true σ [mm]")
    return (
        drawing(depth, f"What the camera measures: {one.job.name}", "depth image of a bent sheet before a wall"),
        drawing(deviation, "True deviation of every pixel that shows the sheet", "map: large where the print is black"),
        drawing(_over_time(first), "Error of the control points over the frames", "one small plot for each geometry"),
        drawing(_meshes(one), "Truth and estimates in the last frame", "two surfaces beside the true one"),
    )


def _over_time(first: Sequence[SequenceResult]) -> "Figure":
    columns = min(len(first), 5)
    rows = -(-len(first) // columns)
    figure = plots.figure(2.4 * columns, 1.9 * rows + 0.4)
    for one, axes in zip(first, figure.subplots(rows, columns, squeeze=False, sharey=True).flat):
        for name, color in (("Euclidean", "tab:orange"), ("likelihood", "tab:blue")):
            axes.plot(one.followed[name].control, color=color, linewidth=0.7, label=name)
        bound = np.sqrt(np.mean([each.posterior[0] ** 2 for each in one.bounds["likelihood"]]))
        axes.axhline(bound, color="0.3", linewidth=0.8, linestyle="--", label="bound")
        axes.set_title(one.job.name, fontsize="small")
        axes.set_ylim(bottom=0)
    figure.supxlabel("frame", fontsize="small")
    figure.supylabel("error [mm]", fontsize="small")
    figure.axes[0].legend(fontsize="x-small")
    return figure


def _meshes(one: SequenceResult) -> "Figure":
    frames = len(one.followed["likelihood"].control)
    truth = one.job.sheet.control(frames / 30)
    surface = SplineSurface((4, 4), 2, np.linspace(0, 1, 16), np.linspace(0, 1, 22))
    figure = plots.figure(9, 3.6)
    for place, name in enumerate(("Euclidean", "likelihood"), start=1):
        axes = figure.add_subplot(1, 2, place, projection="3d")
        axes.set_title(name, fontsize="medium")
        for control, color in ((truth, "0.6"), (one.followed[name].theta, "tab:blue")):
            x, y, z = np.moveaxis(surface.points(control), -1, 0)
            axes.plot_wireframe(x, z, -y, color=color, linewidth=0.5)  # type: ignore[attr-defined]
        axes.tick_params(labelsize="xx-small")
    return figure
